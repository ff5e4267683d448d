from dataclasses import replace

import pytest

from rclzenoh.keys import EntityKind, Token, data_key, dds_type, parse_token, ros_type

NODE = Token(7, "1a2b3c", 4, 4, EntityKind.NODE, "/talos", "sim")
PUBLISHER = Token(
    0,
    "1a2b3c",
    4,
    9,
    EntityKind.PUBLISHER,
    "/",
    "sim",
    "/talos/tf",
    "tf2_msgs::msg::dds_::TFMessage_",
    "RIHS01_e369",
    "::,10:,:,:,,",
)


def test_a_node_token_is_written_as_rmw_zenoh_does():
    assert NODE.key() == "@ros2_lv/7/1a2b3c/4/4/NN/%/%talos/sim"


def test_an_endpoint_token_is_written_as_rmw_zenoh_does():
    assert PUBLISHER.key() == (
        "@ros2_lv/0/1a2b3c/4/9/MP/%/%/sim/%talos%tf/tf2_msgs::msg::dds_::TFMessage_/RIHS01_e369/::,10:,:,:,,"
    )


def test_a_gid_is_the_hash_of_the_token_in_little_endian_order():
    token = parse_token(
        "@ros2_lv/2/1a2b3c4d/0/11/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/"
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18/::,10:,:,:,,"
    )
    assert token.gid.hex() == "d5750f4532486ffa5daaffa683021e1c"


@pytest.mark.parametrize("token", [NODE, PUBLISHER])
def test_tokens_survive_writing_and_parsing(token):
    assert parse_token(token.key()) == token


def test_an_enclave_is_part_of_the_token():
    token = replace(NODE, enclave="/a/b")
    assert "/NN/%a%b/" in token.key()
    assert parse_token(token.key()) == token


@pytest.mark.parametrize(
    "key",
    [
        "",
        "@ros2_lv/0/1a",
        "@ros2_lv/x/1a/0/0/NN/%/%/n",
        "@ros2_lv/0/1a/0/x/NN/%/%/n",
        "@ros2_lv/0/1a/0/0/XX/%/%/n",
        "@ros2_lv/0/1a/0/0/MP/%/%/n",
        "@ros2_lv/0/1a/0/0/MP/%/%/n/%t/type/hash/nonsense",
        "@ros2_lv/0/1a/0/0/MP/%/%/n/%t/type/hash/::,10:,:x,:,,",
        "@ros2_lv/0/1a/0/0/NN//%/n",
        "other/0/1a/0/0/NN/%/%/n",
    ],
)
def test_malformed_tokens_are_ignored(key):
    assert parse_token(key) is None


def test_a_data_key_has_domain_name_type_and_hash():
    key = data_key(0, "/talos/joint_states", "sensor_msgs/msg/JointState", "RIHS01_a1")
    assert key == "0/talos/joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_a1"


@pytest.mark.parametrize("name", ["std_srvs/srv/Trigger", "control_msgs/action/FollowJointTrajectory_SendGoal"])
def test_type_names_survive_translation(name):
    assert ros_type(dds_type(name)) == name
