"""REST on what sensors saw of a stored throw, and on what another camera would have seen."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import Annotated, Any

from fastapi import APIRouter, Body, Response

from throwcollect.config.schema import Config
from throwcollect.config.values import with_sensors
from throwcollect.dataset.directory import PLAN
from throwcollect.dataset.sensors import FRAMES, SensorFrames
from throwcollect.episode.record import Samples
from throwcollect.episode.sensor_topics import SensorDescription, describe_sensor
from throwcollect.errors import NotFoundError
from throwcollect.robots.description import robot_of
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import make_sensor
from throwcollect.serve.instances import Instances
from throwcollect.serve.throw_routes import find_plan, find_throw

_STEP_S = 0.1
"""Time that each picture waits before it is rendered: all clients together get at most ten a second."""


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
    def open_throw(instance: str, trial: int, _changed_ns: int) -> tuple[Config, Samples, dict[str, SensorFrames]]:
        plan, episode = find_throw(instances, instance, trial)
        config = plan.config_of(plan.trial(trial))
        recorded = episode.header, episode.samples(robot_of(config).joints)
        frames = {name: SensorFrames(name, config, *recorded, episode.sensors) for name in config.sensors}
        return config, recorded[1], frames

    @lru_cache(maxsize=1)
    def make_scene(instance: str, trial: int, changed_ns: int) -> Scene:
        return Scene.of(open_throw(instance, trial, changed_ns)[0])

    def find_change(instance: str) -> int:
        """Find when the dataset was begun [ns]: it may be another one than before with the same id."""
        return (find_plan(instances, instance)[0] / PLAN).stat().st_mtime_ns

    @router.get("/sensors")
    def sensors(instance: str, trial: int) -> list[SensorSummary]:
        """The sensors of a throw, in the order of the configuration; none if it has none."""
        with lock:
            config, _, frames = open_throw(instance, trial, find_change(instance))
            return [_describe(name, config, each.time_s.tolist()) for name, each in frames.items()]

    @router.get("/sensors/{name}/{stream}/{frame}", response_class=Response)
    def frame(instance: str, trial: int, name: str, stream: str, frame: int) -> Response:
        """A frame by rows: colors uint8, labels uint16, depths and ranges float32, points 4 float32 (label last)."""
        with lock:
            config, _, frames = open_throw(instance, trial, find_change(instance))
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
            config, samples, _ = open_throw(instance, trial, find_change(instance))
            scene = make_scene(instance, trial, find_change(instance))
            config = with_sensors(config, {"camera": {**camera, "kind": "camera", "streams": ["color"]}})
            number = min(round(time_s * config.record.rate_hz), len(samples) - 1)
            seen = make_sensor("camera", config, scene, trial).look(scene.place_sample(samples, number), number)
        about = json.dumps(vars(_describe("camera", config, [number / config.record.rate_hz])))
        colors = seen["color"]["data"].tobytes()
        return Response(colors, media_type="application/octet-stream", headers={"Sensor": about})

    return router


def _describe(name: str, config: Config, time_s: list[float]) -> SensorSummary:
    return SensorSummary(**vars(describe_sensor(name, config)), time_s=time_s)
