"""REST on components and instances."""

from __future__ import annotations

import os
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field, JsonValue, StrictInt

from throwcollect.files import open_log
from throwcollect.runs.events import EVENTS, parse
from throwcollect.runs.run_record import Origin
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.serve.catalogue import LONGEST_NAME
from throwcollect.serve.instances import Instances
from throwcollect.serve.problem_responses import describe_bytes, problem
from throwcollect.serve.state import ComponentState, InstanceState, describe
from throwcollect.serve.states import States
from throwcollect.wording import suggest


class InstanceRequest(BaseModel):
    """What a client asks for: an instance of a component."""

    model_config = ConfigDict(extra="forbid")

    component: str
    simulations: StrictInt | None = Field(default=None, ge=1, le=256)
    set: dict[str, JsonValue] = Field(default_factory=dict)
    joins: str | None = None

    @property
    def origin(self) -> Origin:
        """The request as the record of the run holds it."""
        return Origin(self.component, self.simulations, self.set, self.joins)


class Scaling(BaseModel):
    """Another number of simulations."""

    model_config = ConfigDict(extra="forbid")

    simulations: StrictInt = Field(ge=0, le=256)


def make_component_routes(states: States) -> APIRouter:
    """Make the routes on components."""
    router = APIRouter(prefix="/components")

    @router.get("")
    async def components() -> list[ComponentState]:
        """All components."""
        return (await states.read()).components

    @router.get("/{name}", response_model=ComponentState)
    async def component(name: str) -> Any:
        """A component."""
        components = (await states.read()).components
        found = next((each for each in components if each.name == name), None)
        return found or problem(404, f"no component {name!r}")

    return router


def make_instance_routes(instances: Instances, states: States) -> APIRouter:
    """Make the routes on instances."""
    router = APIRouter(prefix="/instances")

    @router.get("")
    def all_instances() -> list[InstanceState]:
        """All runs that this machine remembers, the latest first."""
        return states.list_instances()

    @router.get("/{instance}")
    def one(instance: str) -> InstanceState:
        """A run."""
        return describe(instances.get(instance))

    @router.put(
        "/{instance}", status_code=202, responses={200: {"model": InstanceState, "description": "It was begun before"}}
    )
    def put(instance: str, request: InstanceRequest, response: Response) -> InstanceState:
        """Begin an instance of a component; the same request again changes nothing."""
        run, new = instances.put(instance, request.origin)
        if not new:
            response.status_code = 200
        return describe(run)

    @router.post("", status_code=202)
    def post(request: InstanceRequest, response: Response) -> InstanceState:
        """Begin an instance of a component, with an id that is chosen here."""
        run, _ = instances.put(make_id(request.component), request.origin)
        response.headers["Location"] = f"/api/v1/instances/{run.id}"
        return describe(run)

    @router.delete("", status_code=202)
    def delete_all() -> list[str]:
        """Stop all living runs that clients have begun; returns their ids."""
        return instances.stop_all()

    @router.delete("/{instance}", status_code=202)
    def delete(instance: str, force: bool = False) -> None:
        """Stop a run: running trials are finished; by force, everything ends at once, and the run is forgotten."""
        instances.stop(instance, force=force)

    @router.patch("/{instance}", status_code=202)
    def patch(instance: str, scaling: Scaling) -> InstanceState:
        """Change the number of simulations of a run."""
        return describe(instances.scale(instance, scaling.simulations))

    return router


def make_id(component: str) -> str:
    """Make an id for an instance of a component, from the component's name, cut if too long, and the present time."""
    suffix = f"-{time.time_ns() // 1_000_000:x}"
    return component[: LONGEST_NAME - len(suffix)] + suffix


def make_log_routes(instances: Instances) -> APIRouter:
    """Make the routes on logs of nodes and events of runs."""
    router = APIRouter(prefix="/instances")

    @router.get("/{instance}/log/{node}", response_class=PlainTextResponse)
    def log(instance: str, node: str, tail: Annotated[int, Query(ge=1, le=10_000)] = 200) -> Any:
        """The last lines of what a node has printed."""
        # The name is only compared with names of files in the directory, so it cannot lead out of the directory.
        files = NodeLogs(Path(instances.get(instance).record.logs)).files()
        try:
            with open(open_log(files[node], os.O_RDONLY), encoding="utf-8", errors="replace") as file:
                return PlainTextResponse("".join(deque(file, tail)))
        except (KeyError, OSError):
            return problem(404, f"run {instance} has no log of {node!r}{suggest(node, files)}")

    @router.get("/{instance}/events", response_class=Response, responses=describe_bytes("application/x-ndjson"))
    def events(instance: str) -> Response:
        """What has happened in a run, one event in JSON a line."""
        record = instances.get(instance).record
        told: list[str] = []
        # The file does not exist before the first event.
        with (
            suppress(OSError),
            open(open_log(Path(record.logs) / EVENTS, os.O_RDONLY), encoding="utf-8", errors="replace") as file,
        ):
            # If the run resumes a dataset, the file has the events of earlier runs, too.
            told += (line for line in file if (event := parse(line)) and event.run == record.run)
        return Response("".join(told), media_type="application/x-ndjson")

    return router
