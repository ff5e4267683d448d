"""The channels of a recording: topics with their numbers, types and qualities of service, as rosbag2 stores them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from rclzenoh.interfaces import get_message, serialize
from throwcollect.config.schema import Config
from throwcollect.episode.frames import FrameTree, read_frames
from throwcollect.episode.sensor_topics import (
    TF_ID,
    SensorTopic,
    label_channels,
    label_names,
    make_labels,
    optical_frames,
    sensor_topics,
)
from throwcollect.episode.topics import (
    Topic,
    clock,
    controller_state,
    joint_states,
    make_fixed_transforms,
    odometry,
    policy_command,
    transforms,
)
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import moving_bodies_of

ROBOT_DESCRIPTION_ID = 1
TF_STATIC_ID = 2
JOINT_STATES_ID = 3
OBJECT_ODOMETRY_ID = 4
_CLOCK_ID = 5
_FIRST_CONTROLLER_ID = 7
POLICY_COMMAND_ID = 199
FIRST_BODY_ID = 200
"""Bodies of the scene that move, other than the object, follow from this number on."""

_INFINITE_S, _INFINITE_NS = 9223372036, 854775807
"""An infinite duration in rmw: 2^63 - 1 ns."""


@dataclass(frozen=True)
class Qos:
    """Offered quality of service of a reliable publisher that keeps its last `depth` messages.

    With the durability ``transient_local``, late subscribers get these messages, too.
    """

    durability: Literal["volatile", "transient_local"]
    depth: int

    @property
    def profile(self) -> Mapping[str, object]:
        """All policies, in the names and order of rosbag2's metadata since version 9."""
        infinite = {"sec": _INFINITE_S, "nsec": _INFINITE_NS}
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable",
            "durability": self.durability,
            "deadline": infinite,
            "lifespan": infinite,
            "liveliness": "automatic",
            "liveliness_lease_duration": infinite,
            "avoid_ros_namespace_conventions": False,
        }

    @property
    def text(self) -> str:
        """The profile as the list in YAML that rosbag2 stores with an MCAP channel."""
        lines = []
        for key, value in self.profile.items():
            if isinstance(value, dict):
                lines += [f"{key}:", *(f"  {part}: {number}" for part, number in value.items())]
            else:
                lines.append(f"{key}: {str(value).lower()}")
        return "- " + "\n  ".join(lines)


# Depths are those of ROS 2: 10 is usual, 1 that of latched topics, and 100 that of the broadcaster of tf2_ros.
_SAMPLED = Qos("volatile", 10)
_LATCHED = Qos("transient_local", 1)
_TRANSFORMS = Qos("volatile", 100)


@dataclass(frozen=True)
class Channel:
    """One topic of a recording, with its type ``package/msg/Type``, and a number that is the same in every dataset."""

    id: int
    topic: str
    type_name: str
    qos: Qos


class Channels:
    """The channels of the recordings of a configuration.

    Attributes:
        latched: Channels with one message per file: ``/robot_description``, ``/tf_static``, and what the numbers of
            segmentations mean.
        recorded: Channels with one message per sample, in the order of their numbers, with their topics.
        sensors: The topics of each sensor by number of the channel; they have one message for each of its frames.
        robot: URDF text of the robot.

    Raises:
        ConfigError: If the text is not a URDF.
    """

    def __init__(self, config: Config, urdf: str) -> None:
        self.robot, self._config = urdf, config
        self._frames: FrameTree = read_frames(urdf, base_height=config.robot.base_height_m)
        topics = _make_topics(config, self._frames)
        self.recorded: dict[Channel, Topic] = {
            Channel(number, topic.name, topic.type_name, _TRANSFORMS if number == TF_ID else _SAMPLED): topic
            for number, topic in sorted(topics.items())
        }
        self.sensors: dict[str, dict[int, SensorTopic]] = sensor_topics(config)
        self.latched = (
            Channel(ROBOT_DESCRIPTION_ID, "/robot_description", "std_msgs/msg/String", _LATCHED),
            Channel(TF_STATIC_ID, "/tf_static", "tf2_msgs/msg/TFMessage", _LATCHED),
            *(
                Channel(number, topic, "std_msgs/msg/String", _LATCHED)
                for number, topic in label_channels(config).items()
            ),
        )

    def __reduce__(self) -> tuple[type[Channels], tuple[Config, str]]:
        # Topics hold functions, which cannot be sent to another process.
        return Channels, (self._config, self.robot)

    @property
    def all(self) -> tuple[Channel, ...]:
        """All channels, by number."""
        every = {channel.id: channel for channel in (*self.latched, *self.recorded)}
        for topics in self.sensors.values():
            for number, topic in topics.items():
                qos = _TRANSFORMS if number == TF_ID else _SAMPLED
                every.setdefault(number, Channel(number, topic.name, topic.type_name, qos))
        return tuple(every[number] for number in sorted(every))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the channels of an episode's chunk."""
        return tuple(channel.id for channel in self.recorded)

    def encode_latched_messages(self, stamp_ns: int) -> dict[Channel, bytes]:
        """Encode the CDR messages of the latched channels; `stamp_ns` is the stamp of the static transforms [ns]."""
        description, static, *labelled = self.latched
        fixed = (*self._frames.fixed, *optical_frames(self._config))
        labels = label_names(self._frames.links, self._config.acted_on, self._config.bodies)
        return {
            description: serialize(get_message(description.type_name)(data=self.robot)),
            static: serialize(make_fixed_transforms(fixed, stamp_ns)),
            **{channel: serialize(make_labels(labels)) for channel in labelled},
        }


def _make_topics(config: Config, frames: FrameTree) -> dict[int, Topic]:
    chosen, robot = config.record.topics, robot_of(config)
    topics, bodies = {JOINT_STATES_ID: joint_states(robot.joints)}, moving_bodies_of(config)
    for number, name in enumerate(bodies):
        topics[FIRST_BODY_ID + number - 1 if number else OBJECT_ODOMETRY_ID] = odometry(name, number)
    if config.task.policy is not None:
        topics[POLICY_COMMAND_ID] = policy_command(config.moving_joints)
    if "clock" in chosen:
        topics[_CLOCK_ID] = clock()
    if "tf" in chosen:
        topics[TF_ID] = transforms(frames.moving, robot.joints, bodies)
    if "controller_state" in chosen:
        moved = {robot.controller_of(joint) for joint in config.task.end}
        # All controllers are counted, so that each has the same number in every dataset, whichever ones are recorded.
        for number, name in enumerate(robot.controllers, start=_FIRST_CONTROLLER_ID):
            if name in moved:
                topics[number] = controller_state(robot, name)
    return topics
