import array
import copy

import numpy as np
import pytest

from rclzenoh.interfaces import get_message

JointState = get_message("sensor_msgs/msg/JointState")
Pose = get_message("geometry_msgs/msg/Pose")
Uuid = get_message("unique_identifier_msgs/msg/UUID")


def test_messages_do_not_share_their_default_values():
    first, second = JointState(), JointState()
    first.header.frame_id = "base"
    first.name.append("a")
    assert (second.header.frame_id, second.name, len(second.position)) == ("", [], 0)
    assert Pose().orientation.w == 1.0


@pytest.mark.parametrize("value", [[1, 2.5], (1, 2.5), np.array([1, 2.5]), array.array("d", [1, 2.5])])
def test_any_sequence_of_numbers_becomes_an_array(value):
    message = JointState(position=value)
    assert message.position.dtype == np.float64
    assert message.position.tolist() == [1.0, 2.5]
    message.velocity = value
    assert message.velocity.tolist() == [1.0, 2.5]


def test_an_array_of_the_right_type_is_not_copied():
    positions = np.zeros(3)
    assert JointState(position=positions).position is positions


@pytest.mark.parametrize(
    ("value", "match"), [([0] * 15, "expected 16"), ([256] * 16, "does not fit"), ([-1] * 16, "fit")]
)
def test_numbers_that_do_not_fit_are_refused(value, match):
    with pytest.raises(ValueError, match=match):
        Uuid(uuid=value)


def test_a_misspelt_field_is_an_error_that_lists_the_known_ones():
    with pytest.raises(TypeError, match="no field 'positions'; known: header, name, position"):
        JointState(positions=[1.0])
    with pytest.raises(AttributeError, match="positions"):
        JointState().positions = [1.0]


def test_constants_are_attributes_of_the_class():
    assert get_message("action_msgs/msg/GoalStatus").STATUS_ABORTED == 6
    assert get_message("sensor_msgs/msg/NavSatStatus")().status == -2


def test_messages_compare_by_value_and_can_be_copied():
    message = JointState(name=["a"], position=[1.0])
    other = copy.deepcopy(message)
    assert other == message
    other.position[0] = 2.0
    assert other != message
    assert message != Pose()


def test_field_types_are_named_as_in_rosidl():
    assert JointState.get_fields_and_field_types()["position"] == "sequence<double>"
    assert JointState.get_fields_and_field_types()["header"] == "std_msgs/Header"
    assert Uuid.get_fields_and_field_types() == {"uuid": "uint8[16]"}
