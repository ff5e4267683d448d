"""What a simulation is sent for one trial: parameters and joint trajectory goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.robots.talos import CONTROLLERS, controller_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.ros import get_action, get_message

FollowJointTrajectory: Any = get_action("control_msgs/action/FollowJointTrajectory")
JointTrajectoryPoint: Any = get_message("trajectory_msgs/msg/JointTrajectoryPoint")
Duration: Any = get_message("builtin_interfaces/msg/Duration")


@dataclass(frozen=True)
class TrialGoals:
    """The goals of one trial.

    Attributes:
        controllers: Controllers that get a goal, in the robot's order.
        goals: One FollowJointTrajectory goal for each of them.
    """

    controllers: tuple[str, ...]
    goals: tuple[Any, ...]


def trial_goals(trajectory: JointTrajectory, posture: Mapping[str, float]) -> TrialGoals:
    """Split a joint trajectory into one goal per controller.

    Controllers refuse partial goals by default, so joints of a moving limb that do not move are sent where they are.

    Args:
        trajectory: Trajectory of the moving joints.
        posture: Angle of all 32 joints at the start of the trial [rad].
    """
    controllers = tuple(name for name in CONTROLLERS if name in {controller_of(joint) for joint in trajectory.joints})
    return TrialGoals(controllers, tuple(_goal(trajectory, CONTROLLERS[name], posture) for name in controllers))


def _goal(trajectory: JointTrajectory, joints: tuple[str, ...], posture: Mapping[str, float]) -> Any:
    positions = _columns(trajectory.joints, trajectory.positions, joints, [posture[joint] for joint in joints])
    still = [0.0] * len(joints)
    velocities = _columns(trajectory.joints, trajectory.velocities, joints, still)
    accelerations = _columns(trajectory.joints, trajectory.accelerations, joints, still)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = list(joints)
    goal.trajectory.points = [
        JointTrajectoryPoint(
            positions=positions[row],
            velocities=velocities[row],
            accelerations=accelerations[row],
            time_from_start=Duration(sec=stamp // 10**9, nanosec=stamp % 10**9),
        )
        for row, stamp in enumerate(np.rint(trajectory.times * 1e9).astype(np.int64).tolist())
    ]
    return goal


def _columns(
    present: tuple[str, ...], values: NDArray[np.float64], wanted: tuple[str, ...], otherwise: list[float]
) -> NDArray[np.float64]:
    table = np.tile(np.array(otherwise), (len(values), 1))
    for column, joint in enumerate(wanted):
        if joint in present:
            table[:, column] = values[:, present.index(joint)]
    return table
