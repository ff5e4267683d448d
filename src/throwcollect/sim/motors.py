"""How motors follow joint commands: exact feed-forward, a delay of the commands, and a lag behind them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


class Motors:
    """Turns commands of the moving joints into targets of their motors, step by step.

    A command is the position that a joint should have at the end of a step. A motor is given the position that the
    joint should have at the beginning of the step, and the velocity that leads from there to the command.

    Args:
        start: Position that the joints hold before the first command [rad].
        hz: Physics steps per simulated second.
        delay_s: Time between a command and the motor acting on it [s].
        lag_s: Time constant with which motors follow commands [s]; 0: at once.
    """

    def __init__(self, start: Sequence[float], *, hz: int, delay_s: float, lag_s: float) -> None:
        self._hz = float(hz)
        self._lag_s = lag_s
        delay = delay_s * self._hz
        self._fraction = delay % 1
        # The commands that have yet to act: one for each step of the delay, and one more to interpolate from.
        self._acting = np.tile(np.array(start, dtype=float), (int(delay) + 1, 1))
        self._targets = self._acting[:1]
        self._planned = self._acting

    @property
    def target(self) -> list[float]:
        """Position that the joints should have at the end of the last step [rad], after the delay."""
        target: list[float] = self._targets[0].tolist()
        return target

    def plan(self, commands: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Work out targets and velocities of the next steps (see `Steps`); `advance` then gets how many were taken.

        Args:
            commands: Position wanted at the end of each step [rad], before the delay, shape ``(n_steps, n_moving)``.
        """
        count = len(commands)
        self._planned = np.concatenate((self._acting, commands))
        # `_planned` begins as many rows back as the delay has whole steps, so row i + 1 acts at the end of step i. The
        # rest of the delay, a fraction of a step, moves the target towards the row before.
        targets = self._planned[1 : count + 1]
        if self._fraction:
            targets = (1 - self._fraction) * targets + self._fraction * self._planned[:count]
        if self._lag_s:
            targets = lag_behind(targets, self._targets[0], hz=self._hz, lag_s=self._lag_s)
        self._targets = np.concatenate((self._targets[:1], targets))
        return self._targets, (self._targets[1:] - self._targets[:-1]) * self._hz

    def advance(self, steps: int) -> None:
        """Go on by a number of the steps that were planned."""
        self._acting = self._planned[steps : steps + len(self._acting)]
        self._targets = self._targets[steps : steps + 1]


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
