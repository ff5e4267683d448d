"""Translates messages of controllers to values of `throwcollect.control`, and back."""

from __future__ import annotations

from dataclasses import replace

from throwcollect.control import ControllerState, JointTolerance, Trajectory, TrajectoryGoal, TrajectoryPoint
from throwcollect.ros.action import FollowJointTrajectory
from throwcollect.ros.msg import Duration, JointTrajectory, JointTrajectoryControllerState, JointTrajectoryPoint, Time
from throwcollect.ros.msg import JointTolerance as JointToleranceMessage
from throwcollect.units import NS_PER_S

_LONGEST_NS = 2**31 * NS_PER_S - 1
"""Largest time that a message can hold [ns]: its seconds have 32 bits, one of them for the sign."""


def nanoseconds(time: Time | Duration) -> int:
    """Convert a builtin_interfaces Time or Duration to nanoseconds."""
    return int(time.sec) * NS_PER_S + int(time.nanosec)


def read_trajectory(message: JointTrajectory) -> Trajectory:
    """Read the contents of a trajectory_msgs/msg/JointTrajectory."""
    stamp_ns = nanoseconds(message.header.stamp)
    return Trajectory(
        joint_names=tuple(message.joint_names),
        points=tuple(
            TrajectoryPoint(
                nanoseconds(point.time_from_start),
                point.positions,
                point.velocities,
                point.accelerations,
                point.effort,
            )
            for point in message.points
        ),
        # A stamp of zero is ROS' way of leaving it out.
        stamp_ns=stamp_ns or None,
    )


def read_goal(message: FollowJointTrajectory.Goal) -> TrajectoryGoal:
    """Read the contents of a FollowJointTrajectory goal, without the fields that ros2_controllers ignores."""
    return TrajectoryGoal(
        trajectory=read_trajectory(message.trajectory),
        path_tolerance=_read_tolerances(message.path_tolerance),
        goal_tolerance=_read_tolerances(message.goal_tolerance),
        goal_time_tolerance_ns=nanoseconds(message.goal_time_tolerance),
    )


def state_message(state: ControllerState) -> JointTrajectoryControllerState:
    """Make a control_msgs/msg/JointTrajectoryControllerState."""
    message = JointTrajectoryControllerState(
        joint_names=list(state.joint_names),
        # Upstream copies all else of it; feedback of a goal has the efforts, too.
        reference=_point_message(replace(state.desired, effort=())),
        feedback=_point_message(state.actual),
        error=_point_message(state.error),
        output=_point_message(state.output),
        speed_scaling_factor=float(state.speed_scaling_factor),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, NS_PER_S)
    return message


def feedback_message(state: ControllerState) -> FollowJointTrajectory.Feedback:
    """Make a feedback message of FollowJointTrajectory."""
    message = FollowJointTrajectory.Feedback(
        joint_names=list(state.joint_names),
        desired=_point_message(state.desired),
        actual=_point_message(state.actual),
        error=_point_message(state.error),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, NS_PER_S)
    return message


def _read_tolerances(messages: list[JointToleranceMessage]) -> tuple[JointTolerance, ...]:
    return tuple(
        JointTolerance(message.name, message.position, message.velocity, message.acceleration) for message in messages
    )


def _point_message(point: TrajectoryPoint) -> JointTrajectoryPoint:
    message = JointTrajectoryPoint(
        positions=point.positions,
        velocities=point.velocities,
        accelerations=point.accelerations,
        effort=point.effort,
    )
    # A trajectory with a stamp of decades ago can have been going on for longer than a message can hold.
    passed_ns = min(point.time_from_start_ns, _LONGEST_NS)
    message.time_from_start.sec, message.time_from_start.nanosec = divmod(passed_ns, NS_PER_S)
    return message
