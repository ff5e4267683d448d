"""Positions of a curve on a regular grid of times, computed in blocks."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.interpolation import Curve

_BLOCK = 4096
"""Points that are computed at once: enough for whole throws, but limited, as a trajectory may end in years."""


class Grid:
    """A curve at times that are one step apart; from the curve's end on its last position is held.

    Args:
        curve: The curve that is sampled.
        origin_ns: Time of point 0, since the trajectory's start [ns].
        step_ns: Time from one point to the next [ns]; 0 stays at the origin.
    """

    def __init__(self, curve: Curve, origin_ns: int, step_ns: int) -> None:
        self._curve = curve
        self._origin_ns = origin_ns
        self._step_ns = step_ns
        self.end_index = first_index_at(curve.end_ns - origin_ns, step_ns)
        self._block_start = 0
        self._block = np.empty((0, 0))
        # A clock that stands still never gets to the end, so its last position is the position at the origin.
        self._last = curve.state(curve.end_ns if step_ns else origin_ns)[0]

    def time_ns(self, index: int) -> int:
        """Compute the time of a point, since the trajectory's start [ns]."""
        return self._origin_ns + index * self._step_ns

    def position(self, index: int) -> NDArray[np.float64]:
        """Compute the position at one point [rad], shape ``(n_joints,)``, read-only."""
        position: NDArray[np.float64] = self.positions(index, 1)[0]
        return position

    def positions(self, first: int, count: int) -> NDArray[np.float64]:
        """Compute positions at successive points [rad], shape ``(count, n_joints)``, read-only; `first` is an index."""
        stop = first + count
        moving_stop = min(stop, self.end_index if self._step_ns else first)
        if first >= moving_stop:
            return np.broadcast_to(self._last, (count, len(self._last)))
        if not self._block_start <= first or moving_stop > self._block_start + len(self._block):
            self._block_start = first
            self._block = self._compute(first, max(moving_stop, min(first + _BLOCK, self.end_index)) - first)
        moving = self._block[first - self._block_start : moving_stop - self._block_start]
        if moving_stop == stop:
            return moving
        positions = np.vstack((moving, np.broadcast_to(self._last, (stop - moving_stop, len(self._last)))))
        positions.setflags(write=False)
        return positions

    def _compute(self, first: int, count: int) -> NDArray[np.float64]:
        times_ns = self._origin_ns + np.arange(first, first + count, dtype=np.int64) * self._step_ns
        positions = self._curve.positions(times_ns)
        positions.setflags(write=False)
        return positions


def first_index_at(distance_ns: int, step_ns: int) -> int:
    """Find the index of the first point that is at least this far from the origin; `sys.maxsize` if there is none."""
    if distance_ns <= 0:
        return 0
    # This rounds up in whole numbers, because a float cannot tell single nanoseconds of a year.
    return -(-distance_ns // step_ns) if step_ns else sys.maxsize
