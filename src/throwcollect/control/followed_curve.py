"""A curve that is being followed: where the trajectory's clock stands, and the commands of the updates to come."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.interpolation import Curve
from throwcollect.control.sampling import Grid, first_index_at


class Motion:
    """A curve, sampled once a control period.

    In every update the desired positions are those at the time of the trajectory's clock, and the commanded ones those
    one period later. A new instance stands at its first update.

    Args:
        curve: The curve that is followed.
        start_ns: Absolute time of the trajectory's start [ns].
        first_ns: Absolute time of the first update [ns].
        period_ns: Control period [ns].
        scaling: Speed of the trajectory's clock [-].
    """

    def __init__(self, curve: Curve, *, start_ns: int, first_ns: int, period_ns: int, scaling: float = 1.0) -> None:
        self.curve = curve
        self.start_ns = start_ns
        self.first_ns = first_ns
        self._period_ns = period_ns
        self._scaling = scaling
        self._rebase(first_ns - start_ns)

    @property
    def clock_ns(self) -> int:
        """The trajectory's clock: time since its start [ns]."""
        return self._desired.time_ns(self._index)

    @property
    def past_end(self) -> bool:
        """Whether the command of this update is the position of the last point."""
        return self.clock_ns + self._period_ns >= self.curve.end_ns

    @property
    def since_end_ns(self) -> int:
        """Time of the clock since the last point [ns]; negative before."""
        return self.clock_ns - self.curve.end_ns

    @property
    def desired(self) -> NDArray[np.float64]:
        """Positions that are due in this update [rad], shape ``(n_joints,)``, read-only."""
        return self._desired.position(self._index)

    @property
    def command(self) -> NDArray[np.float64]:
        """Positions to command in this update [rad], shape ``(n_joints,)``, read-only."""
        return self._commands.position(self._index + self._ahead)

    def scale(self, scaling: float) -> None:
        """Let the trajectory's clock go at another speed from now on; 0 stops it."""
        self._scaling = scaling
        self._rebase(self.clock_ns)

    def advance(self) -> None:
        """Go to the next update, one control period later."""
        self._index += 1

    def skip(self, n_updates: int) -> NDArray[np.float64]:
        """Go on by many control periods. Return their commands [rad], shape ``(n_updates, n_joints)``, read-only."""
        first = self._index + 1 + self._ahead
        self._index += n_updates
        return self._commands.positions(first, n_updates)

    def updates_until_end(self) -> int:
        """Count the updates before the one in which `past_end` becomes true; negative if it is true already."""
        if self.past_end:
            return -1
        return first_index_at(self.curve.end_ns - self._period_ns - self.clock_ns, self._step_ns) - 1

    def updates_until_late(self, tolerance_ns: int) -> int:
        """Count the updates before the one in which `since_end_ns` exceeds the tolerance; negative if it does so."""
        left_ns = tolerance_ns - self.since_end_ns
        if left_ns < 0:
            return -1
        # This rounds down, because an update exactly at the tolerance is not late.
        return left_ns // self._step_ns if self._step_ns else sys.maxsize

    def _rebase(self, clock_ns: int) -> None:
        self._index = 0
        self._step_ns = round(self._period_ns * self._scaling)
        self._desired = Grid(self.curve, clock_ns, self._step_ns)
        # At full speed a command is the desired position of the next update, so that one grid serves both.
        full_speed = self._step_ns == self._period_ns
        self._ahead = 1 if full_speed else 0
        self._commands = self._desired if full_speed else Grid(self.curve, clock_ns + self._period_ns, self._step_ns)
