from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from rclzenoh import interfaces
from rclzenoh.interfaces import deserialize, get_action, get_message, message_class, serialize
from rclzenoh.interfaces.catalog import structure
from rclzenoh.interfaces.message import DTYPES
from tests.rclzenoh.interfaces.test_stubs import PACKAGING, load_script

DEFINITIONS = Path(interfaces.__file__).parent / "definitions"
FJT = get_action("control_msgs/action/FollowJointTrajectory")
OURS = [
    *(path.relative_to(DEFINITIONS).with_suffix("").as_posix() for path in DEFINITIONS.rglob("*.msg")),
    *(f"{FJT.TYPE}_{part}" for part in ("Goal", "Result", "Feedback", "FeedbackMessage", "SendGoal_Request")),
    "simulation_interfaces/srv/GetEntityState_Response",
    "rcl_interfaces/srv/SetParameters_Request",
]


def random_value(field, random, depth):
    if field.nested:
        return random_message(field.type, random, depth + 1)
    if field.type == "string":
        return random.choice(["", "a", "äß", "joint_17", "x" * 13])
    if field.type == "bool":
        return random.random() < 0.5
    if field.type.startswith("float"):
        return float(np.float32(random.uniform(-1e3, 1e3)))
    info = np.iinfo(DTYPES[field.type])
    return random.randint(int(info.min), int(info.max))


def random_message(name, random, depth=0):
    values = {}
    for field in structure(name).fields:
        if field.length is None and not field.sequence:
            values[field.name] = random_value(field, random, depth)
            continue
        most = min(3 if depth < 3 else 1, field.bound or 3)
        count = random.randint(0, most) if field.length is None else field.length
        values[field.name] = [random_value(field, random, depth) for _ in range(count)]
    return message_class(name)(**values)


@pytest.fixture(scope="module")
def store():
    """Rosbags' own store, to which our definitions are added."""
    store = get_typestore(Stores.ROS2_JAZZY)
    ours = load_script(PACKAGING / "interfaces.py").Interfaces().store.fielddefs
    store.register({name: definition for name, definition in ours.items() if name not in store.fielddefs})
    return store


def check_against_rosbags(name, store, random):
    message = random_message(name, random)
    data = serialize(message)
    theirs = store.deserialize_cdr(data, name)
    assert bytes(store.serialize_cdr(theirs, name)) == data, name
    assert deserialize(data, message_class(name)) == message, name


@pytest.mark.parametrize(
    "package", ["std_msgs", "sensor_msgs", "trajectory_msgs", "tf2_msgs", "rcl_interfaces", "nav_msgs"]
)
@settings(deadline=None, max_examples=3)
@given(random=st.randoms(use_true_random=False))
def test_serialized_messages_equal_those_of_rosbags(store, package, random):
    for name in [name for name in store.fielddefs if name.startswith(f"{package}/msg/")]:
        check_against_rosbags(name, store, random)


@pytest.mark.parametrize("name", OURS)
@settings(deadline=None, max_examples=10)
@given(random=st.randoms(use_true_random=False))
def test_serialized_messages_of_our_definitions_equal_those_of_rosbags(store, name, random):
    check_against_rosbags(name, store, random)


def test_a_known_message_has_known_bytes():
    header = get_message("std_msgs/msg/Header")(frame_id="ab")
    header.stamp.sec, header.stamp.nanosec = 1, 2
    assert serialize(header) == bytes.fromhex("00010000 01000000 02000000 03000000 616200".replace(" ", ""))
    assert serialize(get_message("std_msgs/msg/Empty")()) == bytes.fromhex("0001000000")


def test_received_sequences_may_be_changed_and_share_nothing_with_the_data():
    joints = get_message("sensor_msgs/msg/JointState")
    data = serialize(joints(position=[1.0, 2.0]))
    message = deserialize(data, joints)
    message.position[0] = 5.0
    assert deserialize(data, joints).position.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("more", [bytes(3), bytes(64), b"\x07" * 8])
def test_bytes_after_a_message_are_ignored(more):
    string = get_message("std_msgs/msg/String")
    assert deserialize(serialize(string(data="abc")) + more, string).data == "abc"


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x00\x01", b"\x00\x01\x00", bytes(4), b"\x01\x01\x00\x00abcd"])
def test_data_that_is_not_little_endian_cdr_is_refused(data):
    with pytest.raises(ValueError, match="not little-endian CDR"):
        deserialize(data, get_message("std_msgs/msg/String"))


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=200))
def test_random_bytes_are_decoded_or_refused_with_a_value_error(body):
    for cls in (FJT.Goal, get_message("tf2_msgs/msg/TFMessage"), get_message("rcl_interfaces/msg/ParameterEvent")):
        try:
            deserialize(b"\x00\x01\x00\x00" + body, cls)
        except ValueError:
            continue


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [("frame_id", 5, TypeError), ("stamp", None, TypeError)],
)
def test_a_field_of_another_type_is_refused(field, value, error):
    header = get_message("std_msgs/msg/Header")()
    setattr(header, field, value)
    with pytest.raises(error, match="std_msgs/msg/Header cannot be serialised"):
        serialize(header)


@pytest.mark.parametrize("claimed", [1000, 2**32 - 1])
def test_a_sequence_that_claims_to_be_longer_than_the_data_is_refused_where_the_data_ends(claimed):
    mesh = get_message("shape_msgs/msg/Mesh")
    data = b"\x00\x01\x00\x00" + claimed.to_bytes(4, "little")
    with pytest.raises(ValueError, match="malformed CDR of 908 bytes"):
        deserialize(data + bytes(900), mesh)
    assert len(deserialize(b"\x00\x01\x00\x00\x03\x00\x00\x00" + bytes(40), mesh).triangles) == 3
