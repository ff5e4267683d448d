"""One sensor of a trial: what it sees of a state, its noise, and the fields of the messages that hold it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.config.sensors import CameraConfig, LayersConfig, LidarConfig, PictureConfig, SensorConfig
from throwcollect.engines.pose import Pose
from throwcollect.episode.channels import Channels
from throwcollect.episode.sensor_topics import POINT, frame_of, intrinsics_of
from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.description import full_description
from throwcollect.sensing.camera import Camera, Frame
from throwcollect.sensing.lidar import Lidar, Ranges
from throwcollect.sensing.noise import Noise
from throwcollect.sensing.scene import PlacedScene, Scene
from throwcollect.wording import suggest

Fields = Mapping[str, Any]
"""Numbers of a message, by path of the field."""


class Sensor(ABC):
    """A sensor of one trial.

    Attributes:
        rate_hz: Frames per simulated second.
        latency_s: Time after which a message arrives [s].
    """

    def __init__(self, name: str, section: SensorConfig) -> None:
        frame = frame_of(name, section)
        self.rate_hz, self.latency_s = section.rate_hz, section.latency_s
        self.pose = Pose.of(frame.translation, frame.rotation_xyzw)
        place = "transforms.0.transform."
        self._placed = {f"{place}translation": frame.translation, f"{place}rotation": frame.rotation_xyzw}

    @abstractmethod
    def look(self, placed: PlacedScene, number: int) -> Mapping[str, Fields]:
        """Render the frame of this number, which shows a scene in one state: the fields of its messages, by stream."""


def make_sensor(name: str, config: Config, scene: Scene, trial: int) -> Sensor:
    """Make a sensor of a trial, given its number."""
    section = config.sensors[name]
    if section.link not in scene.links:
        sentence = f"there is no link {section.link!r}{suggest(section.link, scene.links)}"
        raise ConfigError([Problem(sentence, f"sensors.{name}.link")])
    if isinstance(section, PictureConfig):
        return CameraSensor(name, section, config.seed, trial)
    return LidarSensor(name, section, config.seed, trial)


def check_sensors(config: Config) -> None:
    """Check that the sensors of a configuration can be made, and that nothing else has their names."""
    if not config.sensors:
        return
    scene, channels = Scene.of(config), Channels(config, full_description(config))
    taken = {*scene.links, *scene.labels, *(channel.topic.split("/")[1] for channel in channels.recorded)}
    for name in config.sensors:
        if held := taken & {name, f"{name}_frame", f"{name}_optical_frame"}:
            sentence = f"should have another name, as {held.pop()} is a frame or a topic already"
            raise ConfigError([Problem(sentence, f"sensors.{name}")])
        make_sensor(name, config, scene, 0)


class CameraSensor(Sensor):
    """A camera that records colors, depths and labels.

    Attributes:
        camera: Renders its pictures.
    """

    def __init__(self, name: str, section: PictureConfig, seed: int, trial: int) -> None:
        super().__init__(name, section)
        self._section, self._intrinsics = section, intrinsics_of(section)
        self._color, self._depth = (
            Noise(section.noise, seed, trial, f"{name}/{stream}") for stream in ("color", "depth")
        )
        size = section.width, section.height, section.vertical_fov_rad
        shadows = isinstance(section, CameraConfig) and section.shadows
        self.camera = Camera(*size, section.link, self.pose, section.near_m, section.far_m, shadows=shadows)

    def see(self, placed: PlacedScene) -> Frame:
        """Render its picture of a scene in one state, without noise."""
        return self.camera.render(placed, color="color" in self._section.recorded)

    def see_noisily(self, placed: PlacedScene, number: int) -> Frame:
        """Render its picture of a scene in one state, with the noise of the frame of this number."""
        seen = self.see(placed)
        depth = self._depth.distance(seen.depth, number)
        return replace(seen, depth=depth, color=None if seen.color is None else self._color.color(seen.color, number))

    def look(self, placed: PlacedScene, number: int) -> Mapping[str, Fields]:
        """See `Sensor.look`."""
        seen = self.see_noisily(placed, number) if self._section.noise.recorded else self.see(placed)
        depth = seen.depth.astype("<f4")
        if self._section.depth_encoding == "16UC1":
            # Beyond 65 m there is no number of millimetres.
            depth_mm = np.rint(np.where(np.isfinite(depth), depth, 0) * np.float32(1000))
            depth = np.where(depth_mm <= np.iinfo("<u2").max, depth_mm, 0).astype("<u2")
        pictures = {"color": seen.color, "depth": depth, "segmentation": seen.labels.astype("<u2")}
        fields: dict[str, Fields] = {"pose": self._placed}
        for stream in self._section.recorded:
            fields[stream] = {"data": np.ascontiguousarray(pictures[stream]).view(np.uint8).ravel()}
            fields[f"{stream}_info"] = self._intrinsics
        return fields


class LidarSensor(Sensor):
    """A lidar that records ranges or points.

    Attributes:
        lidar: Casts its rays.
    """

    def __init__(self, name: str, section: LidarConfig, seed: int, trial: int) -> None:
        super().__init__(name, section)
        stream = "points" if isinstance(section, LayersConfig) else "scan"
        self._section, self._noise = section, Noise(section.noise, seed, trial, f"{name}/{stream}")
        low, high = section.range_m
        self.lidar = Lidar(section.angles_rad, section.elevations_rad, section.link, self.pose, low, high)

    def see(self, placed: PlacedScene) -> Ranges:
        """Cast its rays into a scene in one state, without noise."""
        return self.lidar.scan(placed)

    def look(self, placed: PlacedScene, number: int) -> Mapping[str, Fields]:
        """See `Sensor.look`."""
        seen = self.see(placed)
        if self._section.noise.recorded:
            seen = replace(seen, ranges=self._noise.distance(seen.ranges, number))
        if not isinstance(self._section, LayersConfig):
            return {"pose": self._placed, "scan": {"ranges": seen.ranges[0]}}
        points = np.empty(seen.ranges.shape, POINT)
        # Where nothing is near enough, there is no point.
        ranges = np.where(np.isfinite(seen.ranges), seen.ranges, np.float32(np.nan))
        points["x"], points["y"], points["z"] = self.lidar.directions * ranges
        points["intensity"] = seen.labels
        return {"pose": self._placed, "points": {"data": points.view(np.uint8).ravel()}}
