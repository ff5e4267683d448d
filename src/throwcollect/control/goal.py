"""Trajectories and goals for a controller, as they arrive, not yet checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = Sequence[float] | NDArray[np.float64]


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
        points: The points.
        stamp_ns: Absolute time of the trajectory's start [ns]; None starts with the next update.
    """

    joint_names: Sequence[str]
    points: Sequence[TrajectoryPoint]
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
