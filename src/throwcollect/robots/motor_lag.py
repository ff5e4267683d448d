"""Computes how motors follow their commands with a lag of the first order."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def lag_behind(
    commands: NDArray[np.float64], start: NDArray[np.float64], *, hz: float, lag_s: float
) -> NDArray[np.float64]:
    """Compute the positions of motors that follow commands.

    In each step, a motor covers the share ``1 - exp(-1 / (hz lag_s))`` of the way to its command.

    Args:
        commands: Commanded positions at the end of each step [rad], shape ``(n_steps, n_joints)``.
        start: Positions of the motors before the first step [rad], shape ``(n_joints,)``.
        hz: Steps per second.
        lag_s: Time constant [s], above 0.

    Returns:
        Positions at the end of each step [rad], shape ``(n_steps, n_joints)``.
    """
    # `expm1` is used, because `1 - exp` would lose the digits of a small share.
    share = -math.expm1(-1.0 / (hz * lag_s))
    reached = np.empty_like(commands)
    last = start
    for step, command in enumerate(commands):
        last = last + share * (command - last)
        reached[step] = last
    return reached
