from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rclzenoh.interfaces import get_message, message_definition
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import Topic, controller_state, joint_states, odometry, transforms
from throwcollect.robots.talos import TALOS

STORE = get_typestore(Stores.ROS2_JAZZY)
STATE = "control_msgs/msg/JointTrajectoryControllerState"
STORE.register(
    {name: fields for name, fields in get_types_from_msg(message_definition(STATE), STATE).items() if name == STATE}
)
SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1.7976931348623157e308]


def wild(shape: tuple[int, ...], *, seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Numbers of every size, and every special value."""
    random = np.random.default_rng(seed)
    numbers = random.normal(size=shape) * 10.0 ** random.integers(-300, 300, size=shape)
    special = random.random(shape) < 0.3
    numbers[special] = random.choice(SPECIAL, size=int(special.sum()))
    return numbers


def messages_of(topic: Topic, samples: Samples, targets: dict[str, ControllerSamples] | None = None) -> list[bytes]:
    return [row.tobytes() for row in topic.encode(samples, targets or {})]


def by_rosbags(type_name: str, **fields: object) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types[type_name](**fields), type_name))


def make_header(stamp_ns: int, frame: str) -> Any:
    sec, nanosec = divmod(stamp_ns, 10**9)
    return STORE.types["std_msgs/msg/Header"](STORE.types["builtin_interfaces/msg/Time"](sec, nanosec), frame)


@pytest.mark.parametrize("count", [1, 500])
def test_joint_states_have_the_bytes_that_rosbags_writes(count: int) -> None:
    topic = joint_states(TALOS.joints)
    columns = [wild((count, 32), seed=seed) for seed in range(3)]
    stamps = np.random.default_rng(3).integers(0, 2**31 * 10**9, size=count)
    empty = np.zeros((count, 3))
    samples = Samples(stamps, *columns, empty, np.zeros((count, 4)), empty, empty)
    for row, message in enumerate(messages_of(topic, samples)):
        assert message == by_rosbags(
            topic.type_name,
            header=make_header(int(stamps[row]), ""),
            name=list(TALOS.joints),
            position=columns[0][row],
            velocity=columns[1][row],
            effort=columns[2][row],
        )


@given(st.integers(0, 2**31 - 1), st.integers(0, 999_999_999), st.lists(st.floats(), min_size=13, max_size=13))
def test_odometry_has_the_bytes_that_rosbags_writes(sec: int, nanosec: int, numbers: list[float]) -> None:
    layout = odometry("ball").layout
    message = np.frombuffer(bytearray(layout.template), layout.dtype)
    message["header.stamp.sec"], message["header.stamp.nanosec"] = sec, nanosec
    message["pose.pose.position"], message["pose.pose.orientation"] = numbers[:3], numbers[3:7]
    message["twist.twist.linear"], message["twist.twist.angular"] = numbers[7:10], numbers[10:]
    types = {name.rpartition("/")[2]: kind for name, kind in STORE.types.items() if name.startswith("geometry_msgs")}
    pose = types["Pose"](types["Point"](*numbers[:3]), types["Quaternion"](*numbers[3:7]))
    twist = types["Twist"](types["Vector3"](*numbers[7:10]), types["Vector3"](*numbers[10:]))
    assert message.tobytes() == by_rosbags(
        "nav_msgs/msg/Odometry",
        header=make_header(sec * 10**9 + nanosec, "world"),
        child_frame_id="ball",
        pose=types["PoseWithCovariance"](pose, np.zeros(36)),
        twist=types["TwistWithCovariance"](twist, np.zeros(36)),
    )


@pytest.mark.parametrize("controller", TALOS.controllers)
def test_controller_states_can_be_read_by_rosbags(controller: str, make_samples: Any, make_set_points: Any) -> None:
    topic, samples, targets = controller_state(TALOS, controller), make_samples(3), make_set_points(controller, 3)
    columns = [TALOS.joints.index(joint) for joint in TALOS.controllers[controller]]
    for row, message in enumerate(messages_of(topic, samples, {controller: targets})):
        state: Any = STORE.deserialize_cdr(message, STATE)
        assert state.joint_names == list(TALOS.controllers[controller])
        assert state.reference.accelerations.tolist() == targets.acceleration[row].tolist()
        assert state.feedback.positions.tolist() == samples.position[row, columns].tolist()
        assert state.error.velocities.tolist() == (targets.velocity - samples.velocity[:, columns])[row].tolist()
        assert state.output.positions.tolist() == targets.output[row].tolist()
        assert state.feedback.time_from_start.nanosec == targets.elapsed_ns[row]
        assert state.speed_scaling_factor == 1.0
        assert STORE.serialize_cdr(state, STATE) == message


def test_transforms_without_moving_frames_hold_only_the_ball(make_samples: Any) -> None:
    topic, samples = transforms((), TALOS.joints), make_samples(2)
    for row, message in enumerate(messages_of(topic, samples)):
        (ball,) = STORE.deserialize_cdr(message, topic.type_name).transforms
        assert (ball.header.frame_id, ball.child_frame_id) == ("world", "ball")
        assert ball.transform.translation.x == samples.object_position[row, 0]
        assert ball.transform.rotation.w == samples.object_orientation_xyzw[row, 3]


def test_fields_after_fields_of_every_kind_are_found() -> None:
    """Strings of odd lengths, bounded and fixed arrays, nested sequences and small integers shift what follows."""
    message = get_message("rcl_interfaces/msg/ParameterEvent")(
        node="/sim",
        new_parameters=[
            get_message("rcl_interfaces/msg/Parameter")(
                name=name,
                value=get_message("rcl_interfaces/msg/ParameterValue")(
                    type=8,
                    bool_value=True,
                    double_array_value=[1.0, 2.0],
                    byte_array_value=[1],
                    string_array_value=["ab"],
                ),
            )
            for name in ("a", "bcd")
        ],
    )
    layout = MessageLayout(message, ["stamp.nanosec", "new_parameters.1.value.double_array_value"])
    changed = np.frombuffer(bytearray(layout.template), layout.dtype)
    changed["stamp.nanosec"], changed["new_parameters.1.value.double_array_value"] = 5, [3.0, math.pi]
    read: Any = STORE.deserialize_cdr(changed.tobytes(), "rcl_interfaces/msg/ParameterEvent")
    assert read.stamp.nanosec == 5
    assert [p.value.double_array_value.tolist() for p in read.new_parameters] == [[1.0, 2.0], [3.0, math.pi]]
    assert [p.name for p in read.new_parameters] == ["a", "bcd"]
