"""How motors go after their commands with a lag of the first order."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def lag_behind(
    commands: NDArray[np.float64], start: NDArray[np.float64], *, hz: float, lag_s: float
) -> NDArray[np.float64]:
    """Where motors go when they are told where to be.

    In each step, a motor makes up for the share ``1 - exp(-1 / (hz lag_s))`` of what it lacks.

    Args:
        commands: Positions wanted at the end of each step [rad], shape ``(n_steps, n_joints)``.
        start: Where the motors are before the first step [rad], shape ``(n_joints,)``.
        hz: Steps per second.
        lag_s: Time constant [s], above 0.

    Returns:
        Positions at the end of each step [rad], shape ``(n_steps, n_joints)``.
    """
    share = -math.expm1(-1.0 / (hz * lag_s))
    reached = np.empty_like(commands)
    last = start
    for step, command in enumerate(commands):
        last = last + share * (command - last)
        reached[step] = last
    return reached
