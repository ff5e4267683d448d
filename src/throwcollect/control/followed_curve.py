"""A curve that is being followed: where the trajectory's clock stands, and the commands of the updates to come."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.interpolation import Curve

_BLOCK = 4096
"""Points that are computed at once: enough for whole throws, but limited, as a trajectory may end in years."""


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
        self._sample_from(first_ns - start_ns)

    @property
    def clock_ns(self) -> int:
        """The trajectory's clock: time since its start [ns]."""
        return self._origin_ns + self._index * self._step_ns

    @property
    def past_end(self) -> bool:
        """Whether the command of this update is the position of the last point."""
        return self._index >= self._commands.end_index

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
        return self._commands.position(self._index)

    def scale(self, scaling: float) -> None:
        """Let the trajectory's clock go at another speed from now on; 0 stops it."""
        self._scaling = scaling
        self._sample_from(self.clock_ns)

    def advance(self) -> None:
        """Go to the next update, one control period later."""
        self._index += 1

    def skip(self, n_updates: int) -> NDArray[np.float64]:
        """Go on by many control periods. Return their commands [rad], shape ``(n_updates, n_joints)``, read-only."""
        first = self._index + 1
        self._index += n_updates
        return self._commands.positions(first, n_updates)

    def updates_until_end(self) -> int:
        """Count the updates before the one in which `past_end` becomes true; negative if it is true already."""
        return self._commands.end_index - self._index - 1

    def updates_until_late(self, tolerance_ns: int) -> int:
        """Count the updates before the one in which `since_end_ns` exceeds the tolerance; negative if it does so."""
        left_ns = tolerance_ns - self.since_end_ns
        if left_ns < 0:
            return -1
        # This rounds down, because an update exactly at the tolerance is not late.
        return left_ns // self._step_ns if self._step_ns else sys.maxsize

    def _sample_from(self, clock_ns: int) -> None:
        self._index, self._origin_ns = 0, clock_ns
        self._step_ns = round(self._period_ns * self._scaling)
        self._desired = _Grid(self.curve, clock_ns, self._step_ns)
        self._commands = _Grid(self.curve, clock_ns + self._period_ns, self._step_ns)


class _Grid:
    """A curve at times that are one step apart; from the curve's end on its last position is held.

    Args:
        curve: The curve that is sampled.
        origin_ns: Time of point 0, since the trajectory's start [ns].
        step_ns: Time from one point to the next [ns]; 0 stays at the origin.
    """

    def __init__(self, curve: Curve, origin_ns: int, step_ns: int) -> None:
        self._curve, self._origin_ns, self._step_ns = curve, origin_ns, step_ns
        self.end_index = _first_index_at(curve.end_ns - origin_ns, step_ns)
        self._block_start, self._block = 0, np.empty((0, 0))
        # A clock that stands still never gets to the end, so its last position is the position at the origin.
        self._last = curve.state(curve.end_ns if step_ns else origin_ns)[0]
        self._last.setflags(write=False)

    def position(self, index: int) -> NDArray[np.float64]:
        """Compute the position at one point [rad], shape ``(n_joints,)``, read-only."""
        return self._last if index >= self.end_index or not self._step_ns else self.positions(index, 1)[0]

    def positions(self, first: int, count: int) -> NDArray[np.float64]:
        """Compute positions at successive points [rad], shape ``(count, n_joints)``, read-only; `first` is an index."""
        if first >= self.end_index or not self._step_ns:
            return np.broadcast_to(self._last, (count, len(self._last)))
        begin = first - self._block_start
        if begin < 0 or begin + count > len(self._block):
            points = np.arange(first, first + max(count, min(_BLOCK, self.end_index - first)), dtype=np.int64)
            times_ns = np.minimum(self._origin_ns + points * self._step_ns, self._curve.end_ns)
            begin, self._block_start, self._block = 0, first, self._curve.positions(times_ns)
            self._block.setflags(write=False)
        return self._block[begin : begin + count]


def _first_index_at(distance_ns: int, step_ns: int) -> int:
    """Find the index of the first point that is at least this far from the origin; `sys.maxsize` if there is none."""
    if distance_ns <= 0:
        return 0
    # This rounds up in whole numbers, because a float cannot tell single nanoseconds of a year.
    return -(-distance_ns // step_ns) if step_ns else sys.maxsize
