"""The MCAP file that viewers open: throws one after another, with robot and markers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import IO

from mcap.writer import CompressionType, Writer

from rclzenoh.interfaces import Message, get_message, serialize
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import LIBRARY
from throwcollect.dataset.mcap_file import PROFILE, declarations
from throwcollect.episode.channels import Channel, Qos
from throwcollect.episode.frames import FrameTree, read_frames
from throwcollect.episode.record import Samples
from throwcollect.episode.topics import (
    joint_states,
    make_fixed_transforms,
    odometry,
    transforms,
)
from throwcollect.publish.view.markers import ShownThrow, all_markers, path_cloud, shape_markers, throw_markers
from throwcollect.robots.description import full_description, robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.robots.tools.tool import tool_of
from throwcollect.sensing.drawn_robot import draw_object_of, draw_robot_of

_SAMPLED = Qos("volatile", 100)
_LATCHED = Qos("transient_local", 1)
_LATCHED_TYPES = {
    "/robot_description": "std_msgs/msg/String",
    "/view/object/robot_description": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/view/robot": "visualization_msgs/msg/MarkerArray",
    "/view/tool": "visualization_msgs/msg/MarkerArray",
    "/view/throws": "visualization_msgs/msg/MarkerArray",
    "/view/throw": "visualization_msgs/msg/MarkerArray",
    "/view/path": "sensor_msgs/msg/PointCloud2",
}


class ViewRecording:
    """Writes the MCAP file of a dataset's configuration to a stream.

    Attributes:
        channels: Its channels.
    """

    def __init__(self, stream: IO[bytes], config: Config) -> None:
        self._looks: tuple[str, str, float] | None = None
        robot = robot_of(config)
        self._topics = [
            transforms(_read_frames(config).moving, robot.joints, moving_bodies_of(config)),
            joint_states(robot.joints),
            odometry(config.acted_on),
        ]
        declared = [(name, kind, _LATCHED) for name, kind in _LATCHED_TYPES.items()]
        declared += [(topic.name, topic.type_name, _SAMPLED) for topic in self._topics]
        self.channels = tuple(Channel(number, *facts) for number, facts in enumerate(declared, start=1))
        self._writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._writer.start(profile=PROFILE, library=LIBRARY)
        schemas, channels = declarations(self.channels)
        for schema in schemas:
            self._writer.register_schema(schema.name, schema.encoding, schema.data)
        self._numbers = {
            channel.topic: self._writer.register_channel(
                channel.topic, channel.message_encoding, channel.schema_id, channel.metadata
            )
            for channel in channels
        }
        self._counts: Counter[int] = Counter()
        self._times = (0, 0)

    def write(self, paths: Sequence[ShownThrow], throws: Iterable[tuple[ShownThrow, Samples]]) -> None:
        """Write throws in order of time, at least one, with their samples and everything else that viewers draw.

        The paths of all of `paths`, the first of which is the first throw, are drawn behind each throw.
        """
        self._put_looks(paths[0])
        self._put("/view/throws", paths[0].start_ns, all_markers(paths))
        for throw, samples in throws:
            self._put_looks(throw)
            self._put("/view/throw", throw.start_ns, throw_markers(throw))
            self._put("/view/path", throw.start_ns, path_cloud(throw))
            self._put_samples(samples, throw.start_ns)

    def finish(self, name: str) -> FileSummary:
        """Write the end of the file, and sum up its contents for a bag's metadata; `name` is the file's name there."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        return FileSummary(name, *self._times, dict(sorted(self._counts.items())))

    def _put_looks(self, throw: ShownThrow) -> None:
        """Write how robot, tool and object of a throw look, unless they look like those of the throw before."""
        config, start = throw.config, throw.start_ns
        looks = full_description(config), draw_object_of(config), config.robot.base_height_m
        if looks == self._looks:
            return
        string = get_message("std_msgs/msg/String")
        robot, tool = draw_robot_of(config), tool_of(config).link
        self._put("/robot_description", start, string(data=robot.urdf))
        self._put("/view/object/robot_description", start, string(data=looks[1]))
        self._put("/tf_static", start, make_fixed_transforms(_read_frames(config).fixed, start))
        parts = {"tool": [shape for shape in robot.shapes if shape.link == tool]}
        if self._looks is None:
            # The robot's meshes are large, and the same in all trials, so they are written only once.
            parts["robot"] = [shape for shape in robot.shapes if shape.link != tool]
        for name, shapes in parts.items():
            self._put(f"/view/{name}", start, shape_markers(name, shapes, robot.locate, start))
        self._looks = looks

    def _put(self, topic: str, stamp_ns: int, message: Message) -> None:
        self._put_data(self._numbers[topic], stamp_ns, serialize(message))

    def _put_data(self, channel: int, stamp_ns: int, data: bytes) -> None:
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, self._counts[channel])
        self._counts[channel] += 1
        self._times = (self._times[0] or stamp_ns, stamp_ns)

    def _put_samples(self, samples: Samples, start_ns: int) -> None:
        # Throws follow one another in this file, so the stamps of the dataset are replaced.
        stamps = samples.stamps_ns - samples.stamps_ns[0] + start_ns
        samples = replace(samples, stamps_ns=stamps)
        columns = [(self._numbers[topic.name], topic.encode(samples, {})) for topic in self._topics]
        for number, stamp in enumerate(stamps.tolist()):
            for channel, messages in columns:
                self._put_data(channel, stamp, messages[number].tobytes())


def _read_frames(config: Config) -> FrameTree:
    return read_frames(full_description(config), base_height=config.robot.base_height_m)
