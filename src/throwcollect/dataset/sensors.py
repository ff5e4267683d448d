"""What a sensor saw in a throw: pictures, depths, labels, ranges and points, read when they are asked for."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.sensors import LayersConfig, PictureConfig
from throwcollect.engines.pose import OPTICAL, Pose
from throwcollect.episode import frames
from throwcollect.episode.chunk import Chunk, count_indexed
from throwcollect.episode.message_table import MessageTable, read_frames
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.episode.sensor_topics import POINT, frame_of, intrinsics_of, label_names, sensor_topics
from throwcollect.episode.topics import Rows, read_stamps
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description, robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.sensing.drawn_robot import DrawnRobot
from throwcollect.sensing.noise import Noise
from throwcollect.sensing.scene import make_scene
from throwcollect.units import NS_PER_S

FRAMES = {"color": "images", "depth": "depth_m", "segmentation": "labels", "scan": "ranges", "points": "points"}
"""What `SensorFrames` calls the frames of each stream."""


class Frames:
    """Frames of one stream, such as ``frames[3]``; ``frames[:]`` is one array of all, with the frame as first axis.

    One chunk of at most 4 MiB is decompressed at a time.
    """

    def __init__(self, count: int, read: Callable[[int], NDArray[Any]]) -> None:
        self._count, self._read = count, read

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return map(self._read, range(self._count))

    def __getitem__(self, index: int | slice) -> NDArray[Any]:
        numbers = range(self._count)[index]
        if isinstance(numbers, range):
            return np.array([self._read(number) for number in numbers])
        return self._read(numbers)


class SensorFrames:
    """The frames of one sensor in a throw.

    Attributes:
        name: Name of the sensor.
        config: Its section of the configuration, with the values of the trial.
        noise: Whether frames get the noise of the configuration when they are read; set it to False for clean ones.
    """

    def __init__(
        self, name: str, config: Config, header: EpisodeHeader, samples: Samples, chunks: Sequence[Chunk]
    ) -> None:
        self.name, self.config = name, config.sensors[name]
        self.noise = not self.config.noise.recorded
        self._whole, self._header = config, header
        self._samples = samples[:: config.record.rate_hz // self.config.rate_hz]
        topics = sensor_topics(config)[name]
        self._topics = {topic.stream: (number, topic) for number, topic in topics.items()}
        self._chunks = [chunk for chunk in chunks if topics.keys() == chunk.indexes.keys()]
        counts = (count_indexed(next(iter(chunk.indexes.values()))) for chunk in self._chunks)
        self._starts = [*accumulate(counts, initial=0)]
        if len(self) != len(self._samples):
            raise DatasetError(f"chunk: {len(self)} frames of {name}", expected=str(len(self._samples)))
        self._table: tuple[int, MessageTable] | None = None

    def __len__(self) -> int:
        return self._starts[-1]

    def __repr__(self) -> str:
        return f"SensorFrames({self.name}: {len(self)} frames of {', '.join(self._topics)})"

    @cached_property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Stamp of each frame, that of the sample that it shows [ns], shape ``(n_frames,)``."""
        topic = next(iter(self._topics.values()))[1]
        rows = (self._rows(number, topic.stream) for number in range(len(self._chunks)))
        return np.concatenate([np.zeros(0, np.int64), *(read_stamps(each, topic.stamp) for each in rows)])

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each frame since the start of the trial [s], shape ``(n_frames,)``."""
        return (self.stamps_ns - self._header.start_ns) / NS_PER_S

    @property
    def images(self) -> Frames:
        """Pictures: arrays of shape ``(height, width, 3)``, uint8, red, green and blue.

        Raises:
            DatasetError: If the sensor has no such stream.
        """
        return self._frames("color")

    @property
    def depth_m(self) -> Frames:
        """Depths along the optical axis [m]: ``(height, width)``, float32; inf where nothing is near enough.

        They are NaN where the noise has a dropout. With ``depth_encoding: 16UC1``, they are rounded to millimetres.
        """
        return self._frames("depth")

    @property
    def labels(self) -> Frames:
        """Numbers in `label_names`: arrays of shape ``(height, width)``, uint16."""
        return self._frames("segmentation")

    @property
    def ranges(self) -> Frames:
        """Ranges of a `lidar_2d` [m], shape ``(rays,)``, float32; inf where nothing is near enough, NaN at dropouts."""
        return self._frames("scan")

    @property
    def points(self) -> Frames:
        """Points of a `lidar_3d` in the frame of the sensor: ``(layers, rays)`` of x, y, z [m] and intensity.

        They are NaN where nothing is near enough, and at dropouts. The intensity is a number in `label_names`.
        """
        return self._frames("points")

    @property
    def label_names(self) -> tuple[str, ...]:
        """Links and bodies by their numbers in `labels`, as ``/<name>/segmentation/labels`` has them."""
        base_height_m = self._whole.robot.base_height_m
        tree = frames.read_frames(full_description(self._whole), base_height=base_height_m)
        return label_names(tree.links, self._whole.acted_on, self._whole.bodies)

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """The matrix K of a camera, shape ``(3, 3)``: it projects the optical frame (x right, y down) to pixels."""
        if not isinstance(self.config, PictureConfig):
            raise DatasetError(f"{self.name} is a {self.config.kind}, and has no intrinsics")
        return np.asarray(intrinsics_of(self.config)["k"]).reshape(3, 3)

    @property
    def poses(self) -> Frames:
        """Where the sensor is: matrices of shape ``(4, 4)`` that take points [m] from its frame to the world.

        The frame of a camera is the optical one (x right, y down, z forward), which `intrinsics` projects; that of a
        lidar has x forward, y left and z up. Column 3 is the position.
        """
        return Frames(len(self), self._find_pose)

    def _find_pose(self, number: int) -> NDArray[np.float64]:
        config, frame = self._whole, frame_of(self.name, self.config)
        # Where links are does not depend on their shapes.
        robot, joints = DrawnRobot(full_description(config), (), Path), robot_of(config).joints
        scene = make_scene(robot, joints, config.robot.base_height_m, (), moving_bodies_of(config))
        link = scene.place_sample(self._samples, number).find(frame.parent)
        pose = link * Pose.of(frame.translation, frame.rotation_xyzw)
        rows, origin = pose * OPTICAL if isinstance(self.config, PictureConfig) else pose
        return np.array([(*row, part) for row, part in zip(rows, origin, strict=True)] + [(0.0, 0.0, 0.0, 1.0)])

    def _frames(self, stream: str) -> Frames:
        if stream not in self._topics:
            raise DatasetError(f"{self.name} has no stream {stream}", expected=" or ".join(self._topics))
        return Frames(len(self), lambda number: self._read(stream, number))

    def _rows(self, chunk: int, stream: str) -> Rows:
        """View the messages of a stream in a chunk; the last chunk that was read is kept."""
        if self._table is None or self._table[0] != chunk:
            try:
                self._table = chunk, read_frames(self._chunks[chunk])
            except DatasetError as error:
                raise error.locate(place=f"trial {self._header.trial}, {self.name}") from error
        number, topic = self._topics[stream]
        messages = self._table[1].messages(number)
        if messages.shape[1] != topic.layout.dtype.itemsize:
            raise DatasetError(f"chunk: the messages of {topic.name} have another layout than those written here")
        rows: Rows = messages.view(topic.layout.dtype)[:, 0]
        return rows

    def _read(self, stream: str, number: int) -> NDArray[Any]:
        chunk = bisect_right(self._starts, number) - 1
        seen = self._decode(stream, self._rows(chunk, stream)[number - self._starts[chunk]])
        if not self.noise or stream == "segmentation":
            return seen
        noise = Noise(self.config.noise, self._whole.seed, self._header.trial, f"{self.name}/{stream}")
        if stream == "points":
            return _move_along_rays(seen, noise, number)
        return noise.color(seen, number) if stream == "color" else noise.distance(seen, number)

    def _decode(self, stream: str, row: Any) -> NDArray[Any]:
        sensor, found = self.config, row["ranges" if stream == "scan" else "data"]
        if isinstance(sensor, LayersConfig):
            found = found.view(POINT).reshape(sensor.layers, sensor.rays)
        elif isinstance(sensor, PictureConfig):
            kind, *colors = {"color": ("u1", 3), "segmentation": ("<u2",)}.get(stream, ("<f4",))
            if stream == "depth" and sensor.depth_encoding == "16UC1":
                depth_mm = found.view("<u2")
                found = np.where(depth_mm == 0, np.float32(np.inf), depth_mm / np.float32(1000))
            found = found.view(kind).reshape(sensor.height, sensor.width, *colors)
        decoded: NDArray[Any] = found
        return decoded


def _move_along_rays(points: NDArray[Any], noise: Noise, number: int) -> NDArray[Any]:
    ranges = np.sqrt(sum(points[axis] * points[axis] for axis in "xyz"))
    moved, shares = points.copy(), noise.distance(ranges, number) / ranges
    for axis in "xyz":
        moved[axis] *= shares
    return moved
