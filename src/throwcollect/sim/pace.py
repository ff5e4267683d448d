"""Keeps pace with real time, in stretches so short that messages leave when things happen.

A *stretch* is the simulated time between two looks at messages.
"""

from __future__ import annotations

import math
import time

from throwcollect.units import NS_PER_S

STRETCH_S = 0.05
"""Simulated time of a stretch while a client watches, and outside of trials: as ros2_controllers send feedback. In real
time, stretches are not longer either, because messages wait for their ends."""

_SHORTEST_S = 0.004
"""Real time of the shortest stretch; it is well above the millisecond of work between two stretches."""
_LATE_S = 0.05
"""Longest delay that is made up for. After a longer one, such as a rest, the schedule begins anew."""


def count_steps(factor: float, hz: int, period: int, phase: int) -> int:
    """Count the physics steps of one stretch, after which samples leave on time.

    Args:
        factor: Simulated over real time [-].
        hz: Physics steps per simulated second.
        period: Physics steps from one sample to the next.
        phase: Physics steps since the last sample.

    Returns:
        Steps until the next sample, or until a later one where the period is shorter than a stretch can be; in slow
        motion, a stretch may end before the next sample.
    """
    periods = math.ceil(_SHORTEST_S * factor * hz / period)
    steps = min(periods * period, max(1, round(STRETCH_S * min(1.0, factor) * hz)))
    # The steps since the last sample count as the beginning of the stretch, so that it ends with a sample. In slow
    # motion, a whole stretch may be no longer than these steps; it is then taken in full, so that time goes on.
    return steps if steps <= phase else steps - phase


class Pace:
    """Ends each stretch on a schedule that goes on from stretch to stretch, so that delays do not add up."""

    def __init__(self) -> None:
        self._factor = 0.0
        self._until_ns = -1
        self._due_s = 0.0

    def wait(self, factor: float, *, began_s: float, since_ns: int, until_ns: int) -> None:
        """Wait until a stretch that has been simulated is due to end.

        Args:
            factor: Simulated over real time [-].
            began_s: Monotonic time at which the stretch began [s].
            since_ns: Simulated time at its beginning [ns].
            until_ns: Simulated time at its end [ns].
        """
        if factor != self._factor or since_ns != self._until_ns or began_s > self._due_s + _LATE_S:
            self._due_s = began_s
        self._factor, self._until_ns = factor, until_ns
        self._due_s += (until_ns - since_ns) / NS_PER_S / factor
        time.sleep(max(0.0, self._due_s - time.monotonic()))
