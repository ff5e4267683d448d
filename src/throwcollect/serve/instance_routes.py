"""REST on instances."""

from __future__ import annotations

import os
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field, JsonValue, StrictInt

from throwcollect.collect.runs.events import EVENTS, parse
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.run_record import Origin
from throwcollect.config.loader import load
from throwcollect.config.shape import shape_of
from throwcollect.config.values import leaves
from throwcollect.errors import NotFoundError
from throwcollect.files import open_log
from throwcollect.serve.catalogue import LONGEST_NAME
from throwcollect.serve.instances import Instances
from throwcollect.serve.state import InstanceState, States, describe
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


class SettableKey(BaseModel):
    """A key that a request may set: its dotted name, its value in the component's configuration, and what it takes."""

    key: str
    value: JsonValue
    takes: str


def make_instance_routes(instances: Instances, states: States) -> APIRouter:
    """Make the routes on instances, and on what a request may set for them."""
    router = APIRouter()

    @router.get("/components/{name}/keys")
    def keys(name: str) -> list[SettableKey]:
        """Keys that a request may set for an instance of a component; none for a container."""
        source = instances.catalogue.get(name).source
        found = leaves(load(source)) if isinstance(source, Path) else ()
        # An item of a list is set with the whole list.
        return [
            SettableKey(key=leaf.name, value=leaf.value, takes=str(shape_of(leaf.name)))
            for leaf in found
            if not leaf.key.operator and not any(part.isdecimal() for part in leaf.name.split("."))
        ]

    @router.get("/instances")
    async def all_instances() -> list[InstanceState]:
        """The runs of the state."""
        return (await states.read()).instances

    @router.get("/instances/{instance}")
    def one(instance: str) -> InstanceState:
        """A run."""
        return describe(instances.get(instance))

    @router.put(
        "/instances/{instance}",
        status_code=202,
        responses={200: {"model": InstanceState, "description": "It was begun before"}},
    )
    def put(instance: str, request: InstanceRequest, response: Response) -> InstanceState:
        """Begin an instance of a component; the same request again changes nothing."""
        run, new = instances.put(instance, request.origin)
        if not new:
            response.status_code = 200
        return describe(run)

    @router.post("/instances", status_code=202)
    def post(request: InstanceRequest, response: Response) -> InstanceState:
        """Begin an instance of a component, with an id that is chosen here."""
        run, _ = instances.put(make_id(request.component), request.origin)
        response.headers["Location"] = f"/api/v1/instances/{run.id}"
        return describe(run)

    @router.delete("/instances/{instance}", status_code=202)
    def delete(instance: str, force: bool = False) -> None:
        """Stop a run: running trials are finished; by force, everything ends at once, and the run is forgotten."""
        instances.stop(instance, force=force)

    @router.patch("/instances/{instance}", status_code=202)
    def patch(instance: str, scaling: Scaling) -> InstanceState:
        """Change the number of simulations of a run."""
        return describe(instances.scale(instance, scaling.simulations))

    return router


def make_log_routes(instances: Instances) -> APIRouter:
    """Make the routes on logs of nodes and events of runs."""
    router = APIRouter()

    @router.get("/instances/{instance}/log/{node}", response_class=PlainTextResponse)
    def log(instance: str, node: str, tail: Annotated[int, Query(ge=1, le=10_000)] = 200) -> PlainTextResponse:
        """The last lines of what a node has printed."""
        # The name is only compared with names of files in the directory, so it cannot lead out of the directory.
        files = NodeLogs(Path(instances.get(instance).record.logs)).files()
        try:
            with open(open_log(files[node], os.O_RDONLY), encoding="utf-8", errors="replace") as file:
                return PlainTextResponse("".join(deque(file, tail)))
        except (KeyError, OSError):
            raise NotFoundError(f"run {instance} has no log of {node!r}{suggest(node, files)}") from None

    @router.get("/instances/{instance}/events", response_class=PlainTextResponse)
    def events(instance: str) -> Response:
        """What has happened in a run, one event in JSON a line."""
        record = instances.get(instance).record
        lines: list[str] = []
        # The file does not exist before the first event.
        with (
            suppress(OSError),
            open(open_log(record.logs / EVENTS, os.O_RDONLY), encoding="utf-8", errors="replace") as file,
        ):
            # If the run resumes a dataset, the file has the events of earlier runs, too.
            lines += (line for line in file if (event := parse(line)) and event.run == record.run)
        return PlainTextResponse("".join(lines), media_type="application/x-ndjson")

    return router


def make_id(component: str) -> str:
    """Make an id for an instance of a component, from the component's name, cut if too long, and the present time."""
    suffix = f"-{time.time_ns() // 1_000_000:x}"
    return component[: LONGEST_NAME - len(suffix)] + suffix
