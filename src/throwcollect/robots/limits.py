"""Limits of the joints of a robot, as its URDF states them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.robots.robot import Robot


@dataclass(frozen=True)
class JointLimits:
    """Limits and damping of the joints of a robot, each of shape ``(n_joints,)`` in the order of `Robot.joints`.

    Attributes:
        lower: Lowest position [rad].
        upper: Highest position [rad].
        velocity: Highest speed [rad/s].
        effort: Highest torque [Nm].
        damping: Viscous friction [Nms/rad].
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    damping: NDArray[np.float64]


@cache
def joint_limits(robot: Robot) -> JointLimits:
    """Read the limits of the joints of a robot."""
    joints = [robot.description.joints[name] for name in robot.joints]
    table = np.array([(*joint.limits, joint.damping) for joint in joints if joint.limits is not None])
    # The result is cached, so all callers have the same arrays, and none may write to them.
    table.flags.writeable = False
    return JointLimits(*table.T)


def shares_of(values: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute magnitudes over their limits [-], of the shape of the values, ``(..., n_joints)``.

    A limit may be 0, because a URDF may have such limits for joints that never move. Then the share of a value of 0 is
    0, and the share of any other value is infinite.
    """
    with np.errstate(divide="ignore", over="ignore"):
        shares: NDArray[np.float64] = np.divide(np.abs(values), limits, out=np.zeros_like(values), where=values != 0)
    return shares
