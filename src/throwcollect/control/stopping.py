"""How joints are stopped: at once, or by braking."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.waypoints import QUINTIC, Waypoints

_LONGEST_S = 60.0
"""Longest time for which a joint brakes: at a speed far above that of any robot, the points would fill all memory."""


def brake(
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    deceleration: NDArray[np.float64],
    period_ns: int,
) -> Waypoints:
    """Make a trajectory on which each joint brakes from its speed to rest, at its own deceleration, within a minute.

    Args:
        positions: Where the joints are [rad], shape ``(n_joints,)``.
        velocities: How they move [rad/s], shape ``(n_joints,)``.
        deceleration: How hard they brake [rad/s²], above 0, shape ``(n_joints,)``.
        period_ns: Control period [ns]: the distance between the points.

    Returns:
        One point a period from now to the first at which all joints rest.
    """
    # `fmin` leaves out speeds that are no numbers, which a physics engine may have for goals far beyond all robots.
    stopping_s = np.fmin(np.abs(velocities) / deceleration, _LONGEST_S)
    count = math.ceil(stopping_s.max() * 1e9 / period_ns) + 1
    times_ns = np.arange(count, dtype=np.int64) * period_ns
    seconds = (times_ns / 1e9)[:, np.newaxis]
    braking = np.minimum(seconds, stopping_s)
    towards = np.where(stopping_s < _LONGEST_S, -np.sign(velocities) * deceleration, -velocities / _LONGEST_S)
    moves = seconds < stopping_s
    content = np.full(count, QUINTIC)
    return Waypoints(
        times_ns,
        positions + velocities * braking + towards / 2 * braking**2,
        np.where(moves, velocities + towards * braking, 0.0),
        np.where(moves, towards, 0.0),
        content,
        content,
    )
