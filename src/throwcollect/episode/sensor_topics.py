"""The topics of sensors: pictures with their intrinsics, scans and point clouds, and the frames that they are in."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import JsonValue

from rclzenoh.interfaces import get_message
from throwcollect.config.schema import Config
from throwcollect.config.sensors import LayersConfig, LidarConfig, PictureConfig, SensorConfig
from throwcollect.engines.body import Placement, turn_of
from throwcollect.engines.engine import GROUND
from throwcollect.episode.frames import Frame
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.topics import make_fixed_transforms, make_header
from throwcollect.reproducible_math import cos, sin

FIRST_SENSOR_ID = 1000
_IDS_OF_SENSOR = 16
"""Numbers of channels that each sensor has, in the order of names, whichever streams it records."""
_LABELS_ID = 15
TF_ID = 6
"""Number of the channel of ``/tf``."""
NOTHING = "background"
"""Label of what no sensor reaches, with the number 0."""
_ENCODINGS = {"color": "rgb8", "depth": "", "segmentation": "mono16"}
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
"""A point of a cloud [m]; the intensity is the number of the link or body that it lies on."""


@dataclass(frozen=True)
class SensorTopic:
    """A topic of a sensor, with one message for each of its frames.

    Attributes:
        stream: What is in it: ``color``, ``depth``, ``segmentation``, ``scan``, ``points``, ``pose``, or ``color_info``
            and so on for the intrinsics of pictures.
        name: Name of the topic.
        type_name: Its message type, ``package/msg/Type``.
        layout: Layout of its messages.
    """

    stream: str
    name: str
    type_name: str
    layout: MessageLayout

    @property
    def stamp(self) -> str:
        """Path of the stamp in its messages."""
        return "transforms.0.header.stamp" if self.stream == "pose" else "header.stamp"


@dataclass(frozen=True)
class SensorDescription:
    """What clients get to know of a sensor.

    Attributes:
        position_m: Its place in its link [m]; it looks along x, with y to its left and z upwards.
        rotation_xyzw: Its rotation in the link, as a quaternion.
        streams: What it has: ``color``, ``depth``, ``segmentation``, ``scan`` or ``points``.
        section: What is below its name in a configuration, with the values of the trial, or of the moment.
    """

    name: str
    position_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]
    streams: list[str]
    section: dict[str, JsonValue]


def sensor_topics(config: Config) -> dict[str, dict[int, SensorTopic]]:
    """Make the topics of each sensor of a configuration, by number of the channel, in the order of names.

    All sensors tell where they are on the channel of ``/tf``, as their poses may differ from trial to trial.
    """
    topics: dict[str, dict[int, SensorTopic]] = {}
    for index, (name, sensor) in enumerate(sorted(config.sensors.items())):
        if isinstance(sensor, PictureConfig):
            made = _make_pictures(name, sensor.recorded, sensor.width, sensor.height, sensor.depth_encoding)
        else:
            made = tuple(_make_ranges(name, sensor))
        first = FIRST_SENSOR_ID + _IDS_OF_SENSOR * index
        topics[name] = {TF_ID: _make_pose(name, sensor.link), **{first + number: topic for number, topic in made}}
    return topics


def label_channels(config: Config) -> dict[int, str]:
    """Name the topics that say what the numbers of segmentations mean, by number of the channel."""
    return {
        FIRST_SENSOR_ID + _IDS_OF_SENSOR * index + _LABELS_ID: f"/{name}/segmentation/labels"
        for index, (name, sensor) in enumerate(sorted(config.sensors.items()))
        if isinstance(sensor, PictureConfig) and "segmentation" in sensor.recorded
    }


def optical_frames(config: Config) -> Iterator[Frame]:
    """List the optical frames of cameras in the frames of these cameras (REP 103): x right, y down, z forward."""
    for name, sensor in sorted(config.sensors.items()):
        if isinstance(sensor, PictureConfig):
            yield Frame(f"{name}_frame", f"{name}_optical_frame", (0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5))


def frame_of(name: str, sensor: SensorConfig) -> Frame:
    """Make the frame of a sensor in its link: x forward, y to the left, z upwards."""
    (x, y, z), look_at_m = sensor.place
    if look_at_m is None:
        roll, pitch, yaw = sensor.rpy_rad or (0.0, 0.0, 0.0)
        turn = turn_of(Placement(rpy=(roll, pitch, yaw)))
    else:
        dx, dy, dz = (at - here for at, here in zip(look_at_m, (x, y, z), strict=True))
        # Half angles of yaw and pitch by square roots alone, which every processor rounds alike.
        level = math.sqrt(dx * dx + dy * dy)
        cos_yaw, cos_pitch = dx / level if level > 0 else 1.0, level / math.sqrt(level * level + dz * dz)
        sy, cy = math.copysign(math.sqrt((1 - cos_yaw) / 2), dy), math.sqrt((1 + cos_yaw) / 2)
        sp, cp = math.copysign(math.sqrt((1 - cos_pitch) / 2), -dz), math.sqrt((1 + cos_pitch) / 2)
        turn = -sy * sp, cy * sp, sy * cp, cy * cp
    return Frame(sensor.link, f"{name}_frame", (x, y, z), turn)


def describe_sensor(name: str, config: Config) -> SensorDescription:
    """Describe a sensor of a configuration for clients."""
    section = config.sensors[name]
    frame = frame_of(name, section)
    streams = [topic.stream for topic in sensor_topics(config)[name].values()]
    streams = [stream for stream in streams if stream != "pose" and not stream.endswith("_info")]
    return SensorDescription(name, frame.translation, frame.rotation_xyzw, streams, section.model_dump())


def focal_length(height: int, vertical_fov_rad: float) -> float:
    """Compute the focal length of a camera in pixels, across and down, as every processor does alike."""
    half = np.array([vertical_fov_rad / 2])
    return float(height / 2 * cos(half)[0] / sin(half)[0])


# Layouts take a millisecond to make, and are the same for all trials.
@lru_cache(maxsize=64)
def _make_pose(name: str, link: str) -> SensorTopic:
    frame = Frame(link, f"{name}_frame", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    message, place = make_fixed_transforms([frame], 0), "transforms.0"
    fields = ("header.stamp.sec", "header.stamp.nanosec", "transform.translation", "transform.rotation")
    layout = MessageLayout(message, [f"{place}.{field}" for field in fields])
    return SensorTopic("pose", "/tf", "tf2_msgs/msg/TFMessage", layout)


@lru_cache(maxsize=64)
def _make_pictures(
    name: str, streams: tuple[str, ...], width: int, height: int, depth_encoding: str
) -> tuple[tuple[int, SensorTopic], ...]:
    header, made = make_header(f"{name}_optical_frame"), []
    stamps, size = ["header.stamp.sec", "header.stamp.nanosec"], {"height": height, "width": width}
    image, info = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
    intrinsics = get_message(info)(header=header, distortion_model="plumb_bob", d=np.zeros(5), **size)
    for number, stream in enumerate(("color", "depth", "segmentation")):
        if stream not in streams:
            continue
        place = f"/{name}" if stream == "color" else f"/{name}/{stream}"
        encoding = depth_encoding if stream == "depth" else _ENCODINGS[stream]
        step = width * {"rgb8": 3, "16UC1": 2, "mono16": 2, "32FC1": 4}[encoding]
        message = get_message(image)(
            header=header, encoding=encoding, step=step, data=np.zeros(step * height, np.uint8), **size
        )
        layouts = MessageLayout(message, [*stamps, "data"]), MessageLayout(intrinsics, [*stamps, "k", "r", "p"])
        made += [
            (2 * number, SensorTopic(stream, f"{place}/image_raw", image, layouts[0])),
            (2 * number + 1, SensorTopic(f"{stream}_info", f"{place}/camera_info", info, layouts[1])),
        ]
    return tuple(made)


def _make_ranges(name: str, lidar: LidarConfig) -> Iterator[tuple[int, SensorTopic]]:
    header, stamps = make_header(f"{name}_frame"), ["header.stamp.sec", "header.stamp.nanosec"]
    if not isinstance(lidar, LayersConfig):
        kind = "sensor_msgs/msg/LaserScan"
        angles = lidar.angles_rad
        message = get_message(kind)(
            header=header,
            angle_min=angles[0],
            angle_max=angles[-1],
            angle_increment=angles[1] - angles[0] if lidar.rays > 1 else 0.0,
            scan_time=1 / lidar.rate_hz,
            range_min=lidar.range_m[0],
            range_max=lidar.range_m[1],
            ranges=np.zeros(lidar.rays, np.float32),
        )
        yield 0, SensorTopic("scan", f"/{name}/scan", kind, MessageLayout(message, [*stamps, "ranges"]))
        return
    kind, field = "sensor_msgs/msg/PointCloud2", get_message("sensor_msgs/msg/PointField")
    step = POINT.itemsize * lidar.rays
    message = get_message(kind)(
        header=header,
        height=lidar.layers,
        width=lidar.rays,
        fields=[
            field(name=part, offset=4 * index, datatype=field.FLOAT32, count=1)
            for index, part in enumerate(POINT.names or ())
        ],
        point_step=POINT.itemsize,
        row_step=step,
        data=np.zeros(step * lidar.layers, np.uint8),
        is_dense=False,
    )
    yield 0, SensorTopic("points", f"/{name}/points", kind, MessageLayout(message, [*stamps, "data"]))


def label_names(links: Sequence[str], acted_on: str, bodies: Iterable[str]) -> tuple[str, ...]:
    """List what the numbers of a segmentation mean.

    Args:
        links: The links: the root first, and the others in the order of the robot's description.
        acted_on: The object.
        bodies: The bodies of the world, with or without the object.
    """
    return (NOTHING, *links, acted_on, GROUND, *(name for name in bodies if name != acted_on))


def make_labels(names: Sequence[str]) -> Any:
    """Make the std_msgs/String, in JSON, that says what the numbers in pictures of the segmentation mean.

    The messages for this in vision_msgs do not come with ROS 2, and Isaac Sim publishes such strings, too.
    """
    return get_message("std_msgs/msg/String")(data=json.dumps(dict(enumerate(names))))


def intrinsics_of(camera: PictureConfig) -> Mapping[str, NDArray[np.float64]]:
    """Compute the matrices k, r and p of a sensor_msgs/CameraInfo, row by row."""
    focal, across, down = (
        focal_length(camera.height, camera.vertical_fov_rad),
        (camera.width - 1) / 2,
        (camera.height - 1) / 2,
    )
    return {
        "k": np.array([focal, 0, across, 0, focal, down, 0, 0, 1.0]),
        "r": np.eye(3).ravel(),
        "p": np.array([focal, 0, across, 0, 0, focal, down, 0, 0, 0, 1.0, 0]),
    }
