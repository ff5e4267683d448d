"""Makes the joint trajectory goals of a trial."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.control import Trajectory, TrajectoryGoal, TrajectoryPoint
from throwcollect.robots.robot import Robot
from throwcollect.robots.trajectory import JointTrajectory


def trial_goals(robot: Robot, trajectory: JointTrajectory, posture: Mapping[str, float]) -> dict[str, TrajectoryGoal]:
    """Split a joint trajectory into one goal for each controller that moves, in the robot's order.

    Controllers refuse partial goals by default. So joints of a moving limb that do not move themselves are sent to
    where they are in `posture`, the angles of all joints at the start of the trial [rad].
    """
    moved = {robot.controller_of(joint) for joint in trajectory.joints}
    return {
        name: _make_goal(trajectory, joints, posture) for name, joints in robot.controllers.items() if name in moved
    }


def _make_goal(trajectory: JointTrajectory, joints: tuple[str, ...], posture: Mapping[str, float]) -> TrajectoryGoal:
    positions = _pick_columns(trajectory.joints, trajectory.positions, joints, [posture[joint] for joint in joints])
    still = [0.0] * len(joints)
    velocities = _pick_columns(trajectory.joints, trajectory.velocities, joints, still)
    accelerations = _pick_columns(trajectory.joints, trajectory.accelerations, joints, still)
    # Times are rounded and not cut off, because a product may lie just below the whole number that is meant.
    stamps = np.rint(trajectory.times * 1e9).astype(np.int64).tolist()
    points = map(TrajectoryPoint, stamps, positions, velocities, accelerations)
    return TrajectoryGoal(Trajectory(joints, tuple(points)))


def _pick_columns(
    present: tuple[str, ...], values: NDArray[np.float64], wanted: tuple[str, ...], otherwise: list[float]
) -> NDArray[np.float64]:
    table = np.tile(np.array(otherwise), (len(values), 1))
    for column, joint in enumerate(wanted):
        if joint in present:
            table[:, column] = values[:, present.index(joint)]
    return table
