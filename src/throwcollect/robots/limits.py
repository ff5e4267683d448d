"""Limits of the joints of a robot, as its URDF states them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError
from throwcollect.robots.robot import Robot, read_xml


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
    """Read the limits of the joints of a robot.

    Raises:
        ConfigError: If the URDF cannot be read or lacks a joint or its limits.
    """
    path = robot.urdf_path
    elements = {
        joint.get("name"): (limit, joint.find("dynamics"))
        for joint in read_xml(path).iter("joint")
        if (limit := joint.find("limit")) is not None
    }
    rows = []
    for name in robot.joints:
        if name not in elements:
            raise ConfigError(f"{path}: joint {name} is missing or has no limit")
        limit, dynamics = elements[name]
        damping = dynamics.get("damping", "0") if dynamics is not None else "0"
        try:
            numbers = [float(limit.attrib[key]) for key in ("lower", "upper", "velocity", "effort")]
            rows.append([*numbers, float(damping)])
        except (KeyError, ValueError) as error:
            raise ConfigError(f"{path}: joint {name}: limit is not readable: {error}") from error
        lower, upper, velocity, effort, *_ = rows[-1]
        # A comparison with NaN is false, so this refuses NaN, too.
        if not (-math.inf < lower <= upper < math.inf and velocity >= 0 and effort >= 0):
            found = ", ".join(f"{key} {limit.get(key)}" for key in ("lower", "upper", "velocity", "effort"))
            raise ConfigError(
                f"{path}: joint {name}: lower should be at most upper, and velocity and effort not below 0: {found}"
            )
    table = np.array(rows)
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
