"""A curve that is being followed: where the trajectory's clock stands, and the commands of the updates to come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.interpolation import Curve

_BLOCK = 4096
"""Updates whose commands are computed at once: whole throws, yet bounded for trajectories that end in years."""


class Motion:
    """A curve, sampled once a control period.

    In every update the desired positions are those of the trajectory's clock, and the commanded ones those of one
    period later. An instance stands at its first update when it is made.

    Args:
        curve: What is followed.
        start_ns: Absolute time of the trajectory's start [ns].
        first_ns: Absolute time of the first update [ns].
        period_ns: Control period [ns].
    """

    def __init__(self, curve: Curve, *, start_ns: int, first_ns: int, period_ns: int) -> None:
        self.curve = curve
        self.start_ns = start_ns
        self.first_ns = first_ns
        self._period_ns = period_ns
        self._rebase(first_ns - start_ns)

    @property
    def clock_ns(self) -> int:
        """The trajectory's clock: time since its start [ns]."""
        return self._origin_ns + self._index * self._period_ns

    @property
    def past_end(self) -> bool:
        """Whether the command of this update is that of the last point."""
        return self._index + 1 >= self._end_index

    @property
    def since_end_ns(self) -> int:
        """Time of the clock since the last point [ns]; negative before."""
        return self.clock_ns - self.curve.end_ns

    @property
    def desired(self) -> NDArray[np.float64]:
        """Positions that are due in this update [rad], shape ``(n_joints,)``, read-only."""
        return self._position(self._index)

    @property
    def command(self) -> NDArray[np.float64]:
        """Positions to command in this update [rad], shape ``(n_joints,)``, read-only."""
        return self._position(self._index + 1)

    def advance(self, period_ns: int) -> None:
        """Go to the next update.

        Args:
            period_ns: Time since the update before [ns].
        """
        if period_ns == self._period_ns:
            self._index += 1
        else:
            self._rebase(self.clock_ns + period_ns)

    def skip(self, n_updates: int) -> NDArray[np.float64]:
        """Go on by many control periods.

        Args:
            n_updates: Number of updates.

        Returns:
            Their commands [rad], shape ``(n_updates, n_joints)``, read-only.
        """
        first = self._index + 2
        self._index += n_updates
        return self._positions(first, first + n_updates)

    def updates_until_end(self) -> int:
        """Updates that follow before the one in which `past_end` becomes true; negative when it is true."""
        return self._end_index - self._index - 2

    def updates_until_late(self, tolerance_ns: int) -> int:
        """Updates that follow before the one in which `since_end_ns` is above a tolerance.

        Args:
            tolerance_ns: [ns].

        Returns:
            Number of updates; negative when this one is late.
        """
        return (tolerance_ns - self.since_end_ns) // self._period_ns

    def _rebase(self, clock_ns: int) -> None:
        self._origin_ns = clock_ns
        self._index = 0
        self._end_index = max(0, -(-(self.curve.end_ns - clock_ns) // self._period_ns))
        self._block_start = 0
        self._block = np.empty((0, 0))
        self._last = self._computed(self._end_index, self._end_index + 1)[0]

    def _position(self, index: int) -> NDArray[np.float64]:
        position: NDArray[np.float64] = self._positions(index, index + 1)[0]
        return position

    def _positions(self, first: int, stop: int) -> NDArray[np.float64]:
        moving_stop = min(stop, self._end_index)
        if first >= moving_stop:
            return np.broadcast_to(self._last, (stop - first, len(self._last)))
        if not self._block_start <= first or moving_stop > self._block_start + len(self._block):
            self._block_start = first
            self._block = self._computed(first, max(moving_stop, min(first + _BLOCK, self._end_index)))
        moving = self._block[first - self._block_start : moving_stop - self._block_start]
        if moving_stop == stop:
            return moving
        positions = np.vstack((moving, np.broadcast_to(self._last, (stop - moving_stop, len(self._last)))))
        positions.setflags(write=False)
        return positions

    def _computed(self, first: int, stop: int) -> NDArray[np.float64]:
        times_ns = self._origin_ns + np.arange(first, stop, dtype=np.int64) * self._period_ns
        positions = self.curve.positions(times_ns)
        positions.setflags(write=False)
        return positions
