from __future__ import annotations

from typing import Any

from ruamel.yaml import YAML

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels, Qos
from throwcollect.robots.description import full_description

URDF = full_description(Config())
ALL = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]


def channels(topics: list[str], **task: Any) -> Channels:
    return Channels(Config.model_validate({"record": {"topics": topics}, "task": task}), URDF)


def test_a_channel_has_the_same_number_in_every_dataset() -> None:
    few = {each.topic: each.id for each in channels(ALL[:2]).all}
    many = {each.topic: each.id for each in channels(ALL).all}
    assert few.items() <= many.items()
    assert few == {"/robot_description": 1, "/tf_static": 2, "/joint_states": 3, "/ball/odometry": 4}
    assert list(many.values()) == sorted(many.values())


def test_controller_states_are_recorded_only_for_controllers_that_move_joints() -> None:
    recorded = channels(ALL, end={"head_1_joint": 0.1}, start={"head_1_joint": 0.0}).recorded
    assert [each.topic for each in recorded if "controller" in each.topic] == ["/head_controller/controller_state"]


def test_the_latched_messages_hold_the_description_and_the_fixed_frames() -> None:
    description, static = channels(ALL).encode_latched_messages(3_000_000_005).values()
    assert deserialize(description, get_message("std_msgs/msg/String")).data == URDF
    transforms = deserialize(static, get_message("tf2_msgs/msg/TFMessage")).transforms
    assert {(each.header.stamp.sec, each.header.stamp.nanosec) for each in transforms} == {(3, 5)}
    assert (transforms[0].header.frame_id, transforms[0].child_frame_id) == ("world", "base_link")
    assert transforms[0].transform.translation.z == Config().robot.base_height_m


def test_the_text_of_a_qos_is_its_profile_in_yaml() -> None:
    qos = Qos("transient_local", 1)
    assert YAML(typ="safe").load(qos.text) == [qos.profile]
    assert qos.text.startswith(
        "- history: keep_last\n  depth: 1\n  reliability: reliable\n  durability: transient_local\n"
    )
