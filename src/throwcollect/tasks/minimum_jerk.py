"""Minimum-jerk motion from rest to rest with a time warp."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.motion import MinimumJerk
from throwcollect.reproducible_math import power
from throwcollect.robots.trajectory import JointTrajectory


def minimum_jerk_trajectory(
    start: Mapping[str, float], end: Mapping[str, float], *, duration_s: float, family: MinimumJerk, points_hz: float
) -> JointTrajectory:
    """Compute points on ``q(t) = q0 + (q1 - q0) s((t/T)^gamma)``, ``s(x) = 10x³ - 15x⁴ + 6x⁵``, and their derivatives.

    Near the start, the motion grows as ``t^(3 gamma)``, so its acceleration grows as ``t^(3 gamma - 2)``: it rises from
    zero if gamma is above 2/3. It would be unbounded for a smaller gamma, which the configuration does not allow.

    Args:
        start: Angle [rad] of at least each joint of `end`.
        end: Angle [rad] of each moving joint; its order is that of the trajectory's joints.
        duration_s: T, the time from rest to rest [s].
        family: The time warp.
        points_hz: Points per second; the last point is at rest, exactly at `end`.
    """
    exponent = 3 * family.gamma - 2
    times = point_times(duration_s, points_hz=points_hz)
    gamma = family.gamma
    u = times / duration_s
    x = power(u, gamma)
    path = x * x * x * (10 + x * (6 * x - 15))
    # These are the derivatives of s(u^gamma) by u. Powers of u are combined into one, because u^(gamma - 1) alone may
    # be infinite at the start.
    speed = 30 * gamma * power(u, exponent + 1) * (1 - x) ** 2
    acceleration = 30 * gamma * power(u, exponent) * (1 - x) * ((3 * gamma - 1) * (1 - x) - 2 * gamma * x)
    origin = np.array([start[joint] for joint in end])
    target = np.array(list(end.values()))
    stroke = target - origin
    positions = origin + path[:, None] * stroke
    positions[-1] = target
    return JointTrajectory(
        joints=tuple(end),
        times=times,
        positions=positions,
        velocities=speed[:, None] * (stroke / duration_s),
        accelerations=acceleration[:, None] * (stroke / duration_s**2),
    )


def point_times(duration_s: float, *, points_hz: float) -> NDArray[np.float64]:
    """List the times of evenly spaced points and of the end.

    A point that would come less than a tenth of the spacing before the end is left out, because the curve between two
    points that nearly coincide is ill-conditioned.

    Returns:
        Times [s] from 0 to exactly `duration_s`, strictly increasing, shape ``(n_points,)`` with at least two.
    """
    times = np.arange(max(1, math.ceil(duration_s * points_hz - 0.1)) + 1) / points_hz
    times[-1] = duration_s
    return times
