"""REST on the sensors of a running simulation, which clients add, change and remove until it ends."""

from __future__ import annotations

import json
from collections.abc import Callable
from threading import Lock
from typing import Annotated, Any

from fastapi import APIRouter, Body

from throwcollect.collect.runs.control import set_parameter
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import require_living
from throwcollect.collect.runtimes.run_listener import take_part
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import with_sensors
from throwcollect.dataset.directory import config_path
from throwcollect.episode.sensor_topics import SensorDescription, describe_sensor
from throwcollect.errors import ConflictError, NotFoundError, WorkerError
from throwcollect.ros import Future
from throwcollect.ros.msg import String
from throwcollect.ros.nodes.sensors.node import LATCHED, NAME
from throwcollect.sensing.sensor import check_sensors
from throwcollect.serve.instances import Instances
from throwcollect.serve.live import name_node
from throwcollect.serve.state import simulations_of
from throwcollect.wording import suggest

_ANSWER_S = 30.0
"""The first request for the sensors of a simulation starts the node that renders them."""
_Section = Annotated[dict[str, Any], Body()]
_Sections = dict[str, dict[str, Any]]


def make_live_sensor_routes(instances: Instances) -> APIRouter:
    """Make the routes on the sensors of running simulations."""
    router = APIRouter(prefix="/instances/{instance}/simulations/{simulation}/sensors")
    # Each change replaces all sections, so two at the same time would undo each other.
    one_at_a_time = Lock()

    def change(instance: str, simulation: str, name: str, alter: Callable[[_Sections], object]) -> Config:
        """Change the sections of the sensors of a simulation, by name."""
        run = instances.get(instance)
        with one_at_a_time:
            config, node = _find(run, simulation)
            sections = {each["name"]: each["section"] for each in _read(run, node)}
            try:
                alter(sections)
            except KeyError:
                raise NotFoundError(f"no sensor {name!r}{suggest(name, sections)}") from None
            config = with_sensors(config, sections)
            check_sensors(config)
            [result] = set_parameter(run, [node], NAME, json.dumps(sections))
        if not result.successful:
            raise ConflictError(f"run {run.id}: {node}: {result.reason}")
        return config

    @router.get("")
    def sensors(instance: str, simulation: str) -> list[SensorDescription]:
        """The sensors of a simulation as they are now."""
        run = instances.get(instance)
        return [SensorDescription(**each) for each in _read(run, _find(run, simulation)[1])]

    @router.put("/{name}")
    def put(instance: str, simulation: str, name: str, section: _Section) -> SensorDescription:
        """Add a sensor to a simulation, or replace it: its section, as it stands in a configuration."""
        return describe_sensor(name, change(instance, simulation, name, lambda found: found.update({name: section})))

    @router.patch("/{name}")
    def patch(instance: str, simulation: str, name: str, section: _Section) -> SensorDescription:
        """Change some keys of a sensor of a simulation."""
        return describe_sensor(name, change(instance, simulation, name, lambda found: found[name].update(section)))

    @router.delete("/{name}", status_code=204)
    def delete(instance: str, simulation: str, name: str) -> None:
        """Remove a sensor from a simulation."""
        change(instance, simulation, name, lambda found: found.pop(name))

    return router


def _find(run: Run, simulation: str) -> tuple[Config, str]:
    """Configuration of a run, and full name of the node and the topic of the sensors of a simulation."""
    if simulation not in (known := simulations_of(require_living(run).nodes)):
        raise NotFoundError(f"run {run.id}: no simulation {simulation!r} runs{suggest(simulation, known)}")
    config = load(config_path(run.context.directory))
    return config, name_node(config, simulation).removesuffix(simulation) + NAME


def _read(run: Run, topic: str) -> Any:
    """Listen to what sensors a simulation has; this starts the node that renders them, unless it runs."""
    if run.connection is None:
        raise ConflictError(f"run {run.id}: is still starting", hint="try again in a moment")
    run.record.middleware.joining.settle()
    heard = Future()
    with take_part(run.connection) as (node, executor):
        node.create_subscription(String, topic, heard.set_result, LATCHED)
        executor.spin_until_future_complete(heard, timeout_sec=_ANSWER_S)
    if not heard.done():
        raise WorkerError(f"run {run.id}: {topic} does not answer")
    return json.loads(heard.result().data)
