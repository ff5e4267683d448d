"""Other software can read a dataset as a rosbag2 bag."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML
from tests.pages import read_section

from rclzenoh.interfaces import type_hash
from throwcollect.dataset.bag import BAG_SECTION
from throwcollect.robots.talos import TALOS

ALL_TOPICS = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]
TYPES = {
    "/robot_description": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/ball/odometry": "nav_msgs/msg/Odometry",
    "/clock": "rosgraph_msgs/msg/Clock",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/arm_right_controller/controller_state": "control_msgs/msg/JointTrajectoryControllerState",
    "/torso_controller/controller_state": "control_msgs/msg/JointTrajectoryControllerState",
}
LATCHED = ("/robot_description", "/tf_static")


@pytest.fixture
def full(make_collection: Any, tmp_path: Path) -> Path:
    settings = {"trials": 4, "record": {"topics": ALL_TOPICS, "trials_per_shard": 3}}
    directory: Path = make_collection(settings).collect(tmp_path / "full", [3, 1, 0, 2])
    return directory


def test_rosbags_and_mcap_read_the_same_messages(full: Path) -> None:
    ours = []
    for path in sorted(full.glob("*.mcap")):
        with path.open("rb") as file:
            for _, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                ours.append((channel.topic, message.log_time, message.data))
    with Reader(full) as reader:
        theirs = [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]
    assert sorted(ours) == sorted(theirs)
    assert {topic for topic, _, _ in ours} == set(TYPES)


def test_the_command_of_the_page_on_viewing_converts_a_dataset_for_older_releases_of_ros(
    full: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = read_section("dataset.md", "Foxglove, Rerun, RViz")
    (command,) = re.findall(r"^rosbags-convert (.*)$", page, re.MULTILINE)
    monkeypatch.chdir(full.parent)
    Path("datasets").mkdir()
    full.rename("datasets/quickstart")
    subprocess.run([sys.executable, "-m", "rosbags.convert", *shlex.split(command)], check=True)
    contents = []
    for bag_directory in ("datasets/quickstart", "bags/quickstart"):
        with Reader(bag_directory) as reader:
            messages = [(each.topic, each.msgtype, stamp, bytes(data)) for each, stamp, data in reader.messages()]
            contents.append((sorted(messages), {each.topic: each.ext for each in reader.connections}))
    assert contents[0] == contents[1]
    assert set(contents[1][1]) == set(TYPES)
    metadata = YAML(typ="safe").load(Path("bags/quickstart/metadata.yaml"))[BAG_SECTION]
    assert metadata["version"] == 8
    # Up to version 8, profiles are a string whose policies are numbers.
    profiles = metadata["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"]
    assert YAML(typ="safe").load(profiles)[0]["reliability"] == 1


def test_every_message_decodes_to_what_was_recorded(full: Path, make_collection: Any) -> None:
    samples = make_collection({"trials": 4}).episode(1).samples()
    first, last = int(samples.stamps_ns[0]), int(samples.stamps_ns[-1])
    with AnyReader([full]) as reader:
        chosen = [each for each in reader.connections if each.topic == "/joint_states"]
        states = [
            (stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages(chosen, start=first, stop=last + 1)
        ]
        others = {
            connection.topic: reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()
        }
    assert [stamp for stamp, _ in states] == samples.stamps_ns.tolist()
    assert all(state.name == list(TALOS.joints) for _, state in states)
    assert np.array_equal(np.array([state.position for _, state in states]), samples.position)
    assert others["/clock"].clock.sec == 65
    assert "<robot" in others["/robot_description"].data
    frames = {(each.header.frame_id, each.child_frame_id) for each in others["/tf"].transforms}
    fixed = {(each.header.frame_id, each.child_frame_id) for each in others["/tf_static"].transforms}
    assert ("world", "ball") in frames
    assert ("world", "base_link") in fixed
    assert len(frames) == 1 + len(TALOS.joints)
    # All frames form one tree: each has one parent, and the root is the world.
    children = [child for _, child in frames | fixed]
    assert len(children) == len(set(children))
    assert {parent for parent, _ in frames | fixed} - set(children) == {"world"}


def test_latched_topics_are_repeated_at_the_start_of_each_file(full: Path) -> None:
    for path in full.glob("*.mcap"):
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            assert summary is not None
            assert summary.statistics is not None
            latched = list(reader.iter_messages(LATCHED))
        assert [channel.topic for _, channel, _ in latched] == list(LATCHED)
        assert {message.log_time for _, _, message in latched} == {summary.statistics.message_start_time}
        assert list(summary.chunk_indexes[0].message_index_offsets) == [1, 2]


def test_recordings_follow_the_conventions_of_the_mcap_plugin_of_rosbag2(full: Path) -> None:
    for path in full.glob("*.mcap"):
        with path.open("rb") as file:
            reader = make_reader(file)
            assert reader.get_header().profile == "ros2"
            summary = reader.get_summary()
            metadata = [record for record in reader.iter_metadata() if record.name == "rosbag2"]
        assert summary is not None
        assert {each.topic: summary.schemas[each.schema_id].name for each in summary.channels.values()} == TYPES
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
            assert sorted(channel.metadata) == ["offered_qos_profiles", "topic_type_hash"]
            assert channel.metadata["topic_type_hash"] == type_hash(schema.name)
            (profile,) = YAML(typ="safe").load(channel.metadata["offered_qos_profiles"])
            assert profile["durability"] == ("transient_local" if channel.topic in LATCHED else "volatile")
            assert profile["lifespan"] == {"sec": 9223372036, "nsec": 854775807}
        copy = YAML(typ="safe").load(metadata[-1].metadata["serialized_metadata"])
        assert copy["relative_file_paths"] == [path.name]
        assert summary.statistics is not None
        assert copy["message_count"] == summary.statistics.message_count


def test_rosbags_reads_counts_times_and_qos_as_the_metadata_says(full: Path) -> None:
    with Reader(full) as reader:
        counts: dict[str, int] = {}
        stamps = []
        for connection, stamp, _ in reader.messages():
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
            stamps.append(stamp)
        assert {each.topic: each.msgcount for each in reader.connections} == counts
        assert reader.message_count == len(stamps)
        assert (reader.start_time, reader.end_time) == (min(stamps), max(stamps) + 1)
        for each in reader.connections:
            (qos,) = each.ext.offered_qos_profiles  # type: ignore[union-attr]
            assert qos.reliability == QosReliability.RELIABLE
            latched = each.topic in LATCHED
            assert qos.durability == (QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE)
            assert each.digest == type_hash(each.msgtype)
