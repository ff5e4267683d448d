"""REST on sensors: what they saw of a stored throw, what another camera would have seen, and those of simulations."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from threading import Lock
from typing import Annotated, Any

from fastapi import APIRouter, Body, Response

from throwcollect.collect.runs.control import set_parameter
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import require_living
from throwcollect.collect.runtimes.run_listener import take_part
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import with_sensors
from throwcollect.dataset.directory import PLAN, config_path
from throwcollect.dataset.sensors import FRAMES, SensorFrames
from throwcollect.episode.record import Samples
from throwcollect.episode.sensor_topics import SensorDescription, describe_sensor
from throwcollect.errors import ConflictError, NotFoundError, WorkerError
from throwcollect.robots.description import robot_of
from throwcollect.ros import Future
from throwcollect.ros.msg import String
from throwcollect.ros.nodes.sensors.node import LATCHED, NAME
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import check_sensors, make_sensor
from throwcollect.serve.instances import Instances
from throwcollect.serve.live import name_node
from throwcollect.serve.state import simulations_of
from throwcollect.serve.throw_routes import find_plan, find_throw
from throwcollect.wording import suggest

_STEP_S = 0.1
"""Time that each picture waits before it is rendered: all clients together get at most ten a second."""
_ANSWER_S = 30.0
"""The first request for the sensors of a simulation starts the node that renders them."""
_Section = Annotated[dict[str, Any], Body()]
_Sections = dict[str, dict[str, Any]]
_OpenThrow = tuple[Config, Samples, dict[str, SensorFrames], Callable[[], Scene]]
"""Configuration and samples of a throw, what each sensor saw, and a function that makes its scene once."""


@dataclass(frozen=True)
class SensorSummary(SensorDescription):
    """A sensor of a throw, with the time of each frame since the start of the throw [s]."""

    time_s: list[float]


def make_sensor_routes(instances: Instances) -> APIRouter:
    """Make the routes on the sensors of stored throws."""
    router = APIRouter(prefix="/collections/{instance}/throws/{trial}")
    # The frames keep the chunk that was decompressed last, so only one request at a time reads them.
    lock, pace = Lock(), Lock()

    # Clients ask for one frame of a throw after the other.
    @lru_cache(maxsize=1)
    def read_throw(instance: str, trial: int, _changed_ns: int) -> _OpenThrow:
        plan, episode = find_throw(instances, instance, trial)
        config = plan.config_of(plan.trial(trial))
        recorded = episode.header, episode.samples(robot_of(config).joints)
        frames = {name: SensorFrames(name, config, *recorded, episode.sensors) for name in config.sensors}
        return config, recorded[1], frames, cache(lambda: Scene.of(config))

    def open_throw(instance: str, trial: int) -> _OpenThrow:
        # The dataset may be another one than before with the same id, which was begun at another time.
        return read_throw(instance, trial, (find_plan(instances, instance)[0] / PLAN).stat().st_mtime_ns)

    @router.get("/sensors")
    def sensors(instance: str, trial: int) -> list[SensorSummary]:
        """The sensors of a throw, in the order of the configuration; none if it has none."""
        with lock:
            config, _, frames, _ = open_throw(instance, trial)
            return [_describe(name, config, each.time_s.tolist()) for name, each in frames.items()]

    @router.get("/sensors/{name}/{stream}/{frame}", response_class=Response)
    def frame(instance: str, trial: int, name: str, stream: str, frame: int) -> Response:
        """A frame by rows: colors uint8, labels uint16, depths and ranges float32, points 4 float32 (label last)."""
        with lock:
            config, _, frames, _ = open_throw(instance, trial)
            streams = _describe(name, config, []).streams if name in frames else []
            if stream not in streams or frame not in range(len(frames[name])):
                raise NotFoundError(f"trial {trial} of run {instance} has no frame {frame} of {name}/{stream}")
            content = getattr(frames[name], FRAMES[stream])[frame].tobytes()
        return Response(content, media_type="application/octet-stream")

    @router.post("/picture", response_class=Response)
    def picture(
        instance: str, trial: int, camera: Annotated[dict[str, Any], Body()], time_s: Annotated[float, Body(ge=0)]
    ) -> Response:
        """Colors that a camera which is not recorded sees; the field `Sensor` of the head describes it as JSON."""
        with pace:
            time.sleep(_STEP_S)
        with lock:
            config, samples, _, make_scene = open_throw(instance, trial)
            scene = make_scene()
            config = with_sensors(config, {"camera": {**camera, "kind": "camera", "streams": ["color"]}})
            number = min(round(time_s * config.record.rate_hz), len(samples) - 1)
            seen = make_sensor("camera", config, scene, trial).look(scene.place_sample(samples, number), number)
        about = json.dumps(vars(_describe("camera", config, [number / config.record.rate_hz])))
        colors = seen["color"]["data"].tobytes()
        return Response(colors, media_type="application/octet-stream", headers={"Sensor": about})

    return router


def _describe(name: str, config: Config, time_s: list[float]) -> SensorSummary:
    return SensorSummary(**vars(describe_sensor(name, config)), time_s=time_s)


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
    config = load(config_path(run.record.directory))
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
