"""What goes into a controller, not yet checked: trajectories and goals; and what comes out: results and states."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Values = Sequence[float] | NDArray[np.float64]
Rows = Sequence[Values] | NDArray[np.float64]


@dataclass(frozen=True)
class TrajectoryPoint:
    """One point of a trajectory; an empty field is absent.

    Attributes:
        time_from_start_ns: Time since the trajectory's start [ns].
        positions: [rad], shape ``(n_joints,)``.
        velocities: [rad/s], shape ``(n_joints,)``.
        accelerations: [rad/s²], shape ``(n_joints,)``.
        effort: [Nm], shape ``(n_joints,)``.
    """

    time_from_start_ns: int
    positions: Values = ()
    velocities: Values = ()
    accelerations: Values = ()
    effort: Values = ()


@dataclass(frozen=True)
class Trajectory:
    """Points to pass, in time (trajectory_msgs/msg/JointTrajectory).

    Attributes:
        joint_names: Joints in the order of each point's fields.
        times_ns: Time of each point since the trajectory's start [ns].
        positions: Those of each point [rad], shape ``(n_points, n_joints)``; empty where a point has none.
        velocities: The same [rad/s].
        accelerations: The same [rad/s²].
        effort: The same [Nm]; no rows for none.
        stamp_ns: Absolute time of the trajectory's start [ns]; None starts with the next update.
    """

    joint_names: Sequence[str]
    times_ns: Sequence[int]
    positions: Rows
    velocities: Rows
    accelerations: Rows
    effort: Rows = ()
    stamp_ns: int | None = None


@dataclass(frozen=True)
class JointTolerance:
    """Tolerances that a goal asks for on one joint: 0 keeps the controller's default, -1 switches it off.

    Attributes:
        name: Name of the joint.
        position: [rad].
        velocity: [rad/s].
        acceleration: [rad/s²].
    """

    name: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True)
class TrajectoryGoal:
    """A goal of control_msgs/action/FollowJointTrajectory.

    Attributes:
        trajectory: The trajectory to follow.
        path_tolerance: Tolerances while moving.
        goal_tolerance: Tolerances at the end.
        goal_time_tolerance_ns: How late the end may be reached [ns]: 0 keeps the controller's default, -1 s waits for
            ever.
    """

    trajectory: Trajectory
    path_tolerance: Sequence[JointTolerance] = ()
    goal_tolerance: Sequence[JointTolerance] = ()
    goal_time_tolerance_ns: int = 0


class GoalStatus(IntEnum):
    """State of a goal (action_msgs/msg/GoalStatus)."""

    EXECUTING = 2
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class ErrorCode(IntEnum):
    """Why a goal ended (control_msgs/action/FollowJointTrajectory)."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class TrajectoryRefusal:
    """Why a trajectory cannot be executed.

    Attributes:
        error_code: The rule that is broken, where the action has a code for it.
        text: One sentence.
    """

    error_code: ErrorCode
    text: str


@dataclass(frozen=True)
class GoalResult:
    """The end of a goal, or of a trajectory that no goal asks for.

    Attributes:
        status: How it ended.
        error_code: Why.
        error_string: Why, in words that begin with upstream's text, which clients know; empty for a cancelled goal.
        goal_id: Identity of the goal, as it was submitted; None without a goal.
    """

    status: GoalStatus
    error_code: ErrorCode
    error_string: str
    goal_id: Hashable | None = None


@dataclass(frozen=True)
class JointState:
    """Measured state of a controller's joints.

    Attributes:
        positions: [rad], shape ``(n_joints,)``.
        velocities: [rad/s], shape ``(n_joints,)``; used where joints brake when they are stopped.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class ControllerState:
    """State of a controller in an update: the content of action feedback and of the controller's state topic.

    Fields are in the controller's joint order and empty where there is no interface.

    Attributes:
        stamp_ns: Time of the update [ns].
        joint_names: Joints of the controller.
        desired: The point that was due (``reference`` of the state topic), timed by the trajectory's clock.
        actual: The measured state (``feedback`` of the state topic), timed by the simulated time that has passed.
        error: Desired minus actual; velocities are 0, as positions alone are commanded.
        output: The command.
        speed_scaling_factor: Speed of the trajectory's clock [-].
    """

    stamp_ns: int
    joint_names: tuple[str, ...]
    desired: TrajectoryPoint
    actual: TrajectoryPoint
    error: TrajectoryPoint
    output: TrajectoryPoint
    speed_scaling_factor: float


@dataclass(frozen=True)
class TrajectoryState:
    """The trajectory at a time that was asked for (control_msgs/srv/QueryTrajectoryState).

    Attributes:
        success: Whether the time lies between the first update and the end.
        positions: [rad], shape ``(n_joints,)``; after the end the last point, before the start the measured state.
        velocities: [rad/s], shape ``(n_joints,)``; None if unknown.
        accelerations: [rad/s²], shape ``(n_joints,)``; None if unknown.
    """

    success: bool
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None
    accelerations: NDArray[np.float64] | None = None
