"""Keeping pace with real time, in slices so short that messages leave when things happen."""

from __future__ import annotations

import math
import time

_SHORTEST_S = 0.004
"""Shortest slice in real time: the work between two slices takes a millisecond."""
_LONGEST_S = 0.05
"""Longest slice in real time: messages wait for its end."""
_LATE_S = 0.05
"""A delay up to this is made up for. After a longer one, such as a rest, the schedule begins anew."""


def longest_steps(factor: float, hz: int) -> int:
    """Physics steps of the longest slice, at a factor [-] and a number of steps per simulated second."""
    return max(1, round(_LONGEST_S * min(1.0, factor) * hz))


def slice_steps(factor: float, hz: int, period: int, phase: int) -> int:
    """Physics steps of one slice.

    Args:
        factor: Simulated over real time [-].
        hz: Physics steps per simulated second.
        period: Physics steps from one sample to the next.
        phase: Physics steps since the last sample.

    Returns:
        The rest of the period, or of a multiple where periods are shorter than a slice can be; in slow motion less.
    """
    periods = math.ceil(_SHORTEST_S * factor * hz / period)
    steps = min(periods * period, longest_steps(factor, hz))
    # The steps since the last sample count as the beginning of the slice, so that it ends with a sample. In slow motion
    # a slice may be no longer than these, and is taken in full.
    return steps if steps <= phase else steps - phase


def long_slice_steps(factor: float, hz: int, most_s: float) -> int:
    """Physics steps of one slice while nobody listens, so that no message has to leave on time.

    Args:
        factor: Simulated over real time [-].
        hz: Physics steps per simulated second.
        most_s: Longest simulated time of a slice [s].
    """
    return max(1, round(min(_LONGEST_S * factor, most_s) * hz))


class Pace:
    """Ends each slice on a schedule that goes on from slice to slice, so that delays do not add up."""

    def __init__(self) -> None:
        self._factor = 0.0
        self._until_ns = -1
        self._due_s = 0.0

    def wait(self, factor: float, *, began_s: float, since_ns: int, until_ns: int) -> None:
        """Wait until a slice that has been simulated is due to end.

        Args:
            factor: Simulated over real time [-].
            began_s: Monotonic time at which the slice began [s].
            since_ns: Simulated time at its beginning [ns].
            until_ns: Simulated time at its end [ns].
        """
        if factor != self._factor or since_ns != self._until_ns or began_s > self._due_s + _LATE_S:
            self._due_s = began_s
        self._factor, self._until_ns = factor, until_ns
        self._due_s += (until_ns - since_ns) / 1e9 / factor
        time.sleep(max(0.0, self._due_s - time.monotonic()))
