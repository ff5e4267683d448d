"""The recorded topics: turns samples into the numbers of their messages, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.config.scene import BALL
from throwcollect.episode.frames import WORLD, Frame
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.errors import DatasetError
from throwcollect.robots.robot import Robot
from throwcollect.units import NS_PER_S

_JOINT_STATE = "sensor_msgs/msg/JointState"
_ODOMETRY = "nav_msgs/msg/Odometry"
BODY_FIELDS = {
    "position": "pose.pose.position",
    "orientation_xyzw": "pose.pose.orientation",
    "linear_velocity": "twist.twist.linear",
    "angular_velocity": "twist.twist.angular",
}
"""What is recorded of a body, in the order of samples, and the fields of its messages that hold it."""
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_MOST_ROBOTS = 8
"""Most robots with cached layouts; there has to be a limit, as files may name any number of robots."""

STAMP = np.dtype([("stamp.sec", "<i4"), ("stamp.nanosec", "<u4")])
"""A builtin_interfaces/Time, as `read_stamps` and `put_stamps` take it."""

Rows = NDArray[np.void]
"""Messages of one topic, one per sample: an array of the layout's structured type."""
SetPoints = Mapping[str, ControllerSamples]
"""Set points of controllers by name."""


@dataclass(frozen=True)
class Topic:
    """One recorded topic.

    Attributes:
        name: Name of the topic.
        type_name: Its message type, ``package/msg/Type``.
        layout: Layout of its messages.
        fill: Writes the varying fields into messages that are copies of the layout's template.
    """

    name: str
    type_name: str
    layout: MessageLayout
    fill: Callable[[Rows, Samples, SetPoints], None]

    def encode(self, samples: Samples, targets: SetPoints) -> NDArray[np.uint8]:
        """Make the CDR messages of all samples, shape ``(n_samples, size)``."""
        template = np.frombuffer(self.layout.template, np.uint8)
        messages = np.tile(template, (len(samples), 1))
        self.fill(messages.view(self.layout.dtype)[:, 0], samples, targets)
        return messages


def put_stamps(rows: Rows, prefix: str, times_ns: NDArray[np.int64]) -> None:
    """Write times [ns], shape ``(n,)``, into the fields of messages that hold seconds and nanoseconds."""
    rows[f"{prefix}.sec"], rows[f"{prefix}.nanosec"] = np.divmod(times_ns, NS_PER_S)


def read_stamps(rows: Rows, prefix: str) -> NDArray[np.int64]:
    """Read the times [ns] that `put_stamps` writes, shape ``(n,)``."""
    times: NDArray[np.int64] = rows[f"{prefix}.sec"].astype(np.int64) * NS_PER_S + rows[f"{prefix}.nanosec"]
    return times


def rotate(quaternion_xyzw: NDArray[np.float64], *vectors: NDArray[np.float64], inverse: bool) -> NDArray[np.float64]:
    """Turn vectors, each of shape ``(n, 3)``, by unit quaternions, shape ``(n, 4)``, or in the opposite direction.

    This is computed element by element, so the result of a row does not depend on other rows.

    Returns:
        Shape ``(len(vectors), n, 3)``.
    """
    # The elements of recorded columns lie far apart in memory, and the code below reads them many times.
    *axis, w = np.ascontiguousarray(quaternion_xyzw.T)
    u = _repeat_axes((np.negative(axis) if inverse else np.array(axis))[:, np.newaxis])
    v = _repeat_axes(np.array([vector.T for vector in vectors]).swapaxes(0, 1))
    # v' = v + w t + u × t with t = 2 u × v, for a unit quaternion (u, w).
    t = _repeat_axes(2 * _compute_cross(u, v))
    turned: NDArray[np.float64] = (v[:3] + w * t[:3] + _compute_cross(u, t)).transpose(1, 2, 0)
    return turned


def _repeat_axes(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Repeat the first axis, x, y, z, x, y, z, so that cyclic permutations of the axes are slices."""
    return np.concatenate([axes, axes])


def _compute_cross(left: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the cross products of two results of `_repeat_axes`."""
    crossed: NDArray[np.float64] = left[1:4] * right[2:5] - left[2:5] * right[1:4]
    return crossed


@lru_cache(maxsize=_MOST_ROBOTS)
def joint_states(joints: tuple[str, ...]) -> Topic:
    """``/joint_states``: sensor_msgs/JointState with all joints of a robot, at least one, in the samples' order."""
    zeros = np.zeros(len(joints))
    message = get_message(_JOINT_STATE)(name=list(joints), position=zeros, velocity=zeros, effort=zeros)
    layout = MessageLayout(message, [*_STAMP, "position", "velocity", "effort"])
    return Topic("/joint_states", _JOINT_STATE, layout, _fill_joint_states)


def read_joint_names(message: bytes) -> tuple[str, ...]:
    """Read the names of the joints in a message of `joint_states`, in the order of its numbers."""
    joints = tuple(_read_message(message, _JOINT_STATE).name)
    if not joints:
        raise DatasetError("chunk: joint states that name no joint")
    return joints


def _fill_joint_states(rows: Rows, samples: Samples, _: SetPoints) -> None:
    put_stamps(rows, "header.stamp", samples.stamps_ns)
    rows["position"] = samples.position
    rows["velocity"] = samples.velocity
    rows["effort"] = samples.effort


@lru_cache(maxsize=64)
def odometry(name: str, number: int = 0) -> Topic:
    """``/ball/odometry``, or ``/bodies/<name>/odometry`` of a body of the scene: nav_msgs/Odometry.

    The pose is in world, the twist in the body's own frame, covariances are 0 (unknown). The object has the number 0,
    other bodies that move count from 1.
    """
    layout = MessageLayout(
        get_message(_ODOMETRY)(header=make_header(WORLD), child_frame_id=name), [*_STAMP, *BODY_FIELDS.values()]
    )

    def fill(rows: Rows, samples: Samples, _: SetPoints) -> None:
        put_stamps(rows, "header.stamp", samples.stamps_ns)
        position, turn, *velocities = samples.parts_of(number)
        rows["pose.pose.position"], rows["pose.pose.orientation"] = position, turn
        turned = rotate(turn, *velocities, inverse=True)
        rows["twist.twist.linear"], rows["twist.twist.angular"] = turned

    return Topic("/ball/odometry" if name == BALL else f"/bodies/{name}/odometry", _ODOMETRY, layout, fill)


def read_body_name(message: bytes) -> str:
    """Read the name of the body in a message of `odometry`."""
    # Most bodies are balls, and comparing bytes is faster than reading the message.
    if odometry(BALL).layout.describes_message(message):
        return BALL
    return str(_read_message(message, _ODOMETRY).child_frame_id)


def _read_message(message: bytes, kind: str) -> Any:
    try:
        return deserialize(message, get_message(kind))
    except ValueError as error:
        raise DatasetError(f"chunk: {error}") from error


def make_header(frame: str, stamp_ns: int = 0) -> Any:
    """Make a std_msgs/Header."""
    sec, nanosec = divmod(stamp_ns, NS_PER_S)
    stamp = get_message("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)
    return get_message("std_msgs/msg/Header")(stamp=stamp, frame_id=frame)


@cache
def clock() -> Topic:
    """``/clock``: rosgraph_msgs/Clock, the stamp of each sample."""
    kind = "rosgraph_msgs/msg/Clock"
    return Topic("/clock", kind, MessageLayout(get_message(kind)(), ["clock.sec", "clock.nanosec"]), _fill_clock)


def _fill_clock(rows: Rows, samples: Samples, _: SetPoints) -> None:
    put_stamps(rows, "clock", samples.stamps_ns)


def transforms(frames: tuple[Frame, ...], joints: Sequence[str], bodies: Sequence[str] = (BALL,)) -> Topic:
    """``/tf``: tf2_msgs/TFMessage with object and moving bodies in world, and every frame that a joint moves."""
    kind = "tf2_msgs/msg/TFMessage"
    columns = [joints.index(frame.joint) for frame in frames]
    free = [Frame(WORLD, name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for name in bodies]
    message, count = make_fixed_transforms([*free, *frames], 0), len(free) + len(frames)
    variable = [f"transforms.{n}.{path}" for n in range(count) for path in (*_STAMP, "transform.rotation")]
    # The translations of frames that joints turn stand in the template.
    slides = (number for number, frame in enumerate(frames, start=len(free)) if frame.slides)
    moved = [*range(len(free)), *slides]
    layout = MessageLayout(message, [*variable, *(f"transforms.{n}.transform.translation" for n in moved)])

    def fill(rows: Rows, samples: Samples, _: SetPoints) -> None:
        for number in range(count):
            put_stamps(rows, f"transforms.{number}.header.stamp", samples.stamps_ns)
        for number in range(len(bodies)):
            position, rotation, *_velocities = samples.parts_of(number)
            rows[f"transforms.{number}.transform.translation"] = position
            rows[f"transforms.{number}.transform.rotation"] = rotation
        for number, (frame, column) in enumerate(zip(frames, columns, strict=True), start=len(free)):
            position = samples.position[:, column]
            if frame.slides:
                rows[f"transforms.{number}.transform.translation"] = frame.translation_at(position)
                rows[f"transforms.{number}.transform.rotation"] = frame.rotation_xyzw
            else:
                rows[f"transforms.{number}.transform.rotation"] = frame.rotation_at(position)

    return Topic("/tf", kind, layout, fill)


def make_fixed_transforms(frames: Sequence[Frame], stamp_ns: int) -> Any:
    """Make the tf2_msgs/TFMessage of frames that never move."""
    return get_message("tf2_msgs/msg/TFMessage")(transforms=[_make_transform(frame, stamp_ns) for frame in frames])


def _make_transform(frame: Frame, stamp_ns: int) -> Any:
    """Make the geometry_msgs/TransformStamped of a frame."""
    x, y, z = frame.translation
    qx, qy, qz, qw = frame.rotation_xyzw
    transform = get_message("geometry_msgs/msg/Transform")(
        translation=get_message("geometry_msgs/msg/Vector3")(x=x, y=y, z=z),
        rotation=get_message("geometry_msgs/msg/Quaternion")(x=qx, y=qy, z=qz, w=qw),
    )
    return get_message("geometry_msgs/msg/TransformStamped")(
        header=make_header(frame.parent, stamp_ns), child_frame_id=frame.child, transform=transform
    )


def controller_state(robot: Robot, controller: str) -> Topic:
    """``/<controller>/controller_state``: control_msgs/JointTrajectoryControllerState of one controller.

    Reference, feedback and error have positions and velocities, the reference has accelerations, the output positions.
    """
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    point = get_message("trajectory_msgs/msg/JointTrajectoryPoint")
    joints = robot.controllers[controller]
    columns = [robot.joints.index(joint) for joint in joints]
    zeros = np.zeros(len(joints))
    message = get_message(kind)(
        joint_names=list(joints),
        reference=point(positions=zeros, velocities=zeros, accelerations=zeros),
        feedback=point(positions=zeros, velocities=zeros),
        error=point(positions=zeros, velocities=zeros),
        output=point(positions=zeros),
        speed_scaling_factor=1.0,
    )
    points = [f"{part}.{key}" for part in ("reference", "feedback", "error") for key in ("positions", "velocities")]
    elapsed = [f"{part}.time_from_start.{key}" for part in _TIMED for key in ("sec", "nanosec")]
    layout = MessageLayout(message, [*_STAMP, *points, *elapsed, "reference.accelerations", "output.positions"])

    def fill(rows: Rows, samples: Samples, targets: SetPoints) -> None:
        target = targets[controller]
        position, velocity = samples.position[:, columns], samples.velocity[:, columns]
        put_stamps(rows, "header.stamp", samples.stamps_ns)
        for part in _TIMED:
            put_stamps(rows, f"{part}.time_from_start", target.elapsed_ns)
        rows["reference.positions"], rows["reference.velocities"] = target.position, target.velocity
        rows["reference.accelerations"] = target.acceleration
        rows["feedback.positions"], rows["feedback.velocities"] = position, velocity
        # As in ros2_controllers, the error is the reference minus the feedback.
        rows["error.positions"], rows["error.velocities"] = target.position - position, target.velocity - velocity
        rows["output.positions"] = target.output

    return Topic(f"/{controller}/controller_state", kind, layout, fill)


def policy_command(joints: tuple[str, ...]) -> Topic:
    """``/policy/command``: std_msgs/Float64MultiArray with the positions that a policy asked for, and those sent."""
    kind, count = "std_msgs/msg/Float64MultiArray", len(joints)
    dimension = get_message("std_msgs/msg/MultiArrayDimension")
    rows = dimension(label="asked,sent", size=2, stride=2 * count)
    shape = get_message("std_msgs/msg/MultiArrayLayout")(
        dim=[rows, dimension(label=",".join(joints), size=count, stride=count)]
    )
    layout = MessageLayout(get_message(kind)(layout=shape, data=np.zeros(2 * count)), ["data"])

    def fill(rows: Rows, samples: Samples, _: SetPoints) -> None:
        # Clients of a running simulation get the commands of a trial only with its episode.
        if samples.command.size:
            rows["data"] = samples.command.reshape(len(samples), -1)

    return Topic("/policy/command", kind, layout, fill)


def read_policy_joints(message: bytes) -> tuple[str, ...]:
    """Read the names of the joints in a message of `policy_command`."""
    dimensions = _read_message(message, "std_msgs/msg/Float64MultiArray").layout.dim
    if len(dimensions) != 2:
        raise DatasetError("chunk: a command of a policy that names no joints")
    return tuple(dimensions[1].label.split(","))


_TIMED = ("reference", "feedback", "error")
