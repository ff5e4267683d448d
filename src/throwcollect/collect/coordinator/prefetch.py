"""How many trials a simulation is given at once."""

from __future__ import annotations

import math
import time

_AHEAD_S = 0.5
"""Real time that the trials in the list of a simulation should last. As much work is lost when the simulation is lost,
and the other simulations may wait as long for it at the end."""
_MOST = 16
"""Most trials in a list: longer lists save no time that could be measured."""
_WEIGHT = 0.3
"""Weight of the last trial in the mean duration of a trial."""


class Prefetch:
    """Measures how long simulations take for a trial, so that each has work for a while and none for too long.

    A simulation that has done no trial yet is given one.
    """

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._durations: dict[str, float] = {}

    def begin(self, simulation: str) -> None:
        """Note that a simulation that had nothing to do has got a trial."""
        self._since[simulation] = time.monotonic()

    def end(self, simulation: str) -> None:
        """Note that a simulation has done a trial."""
        now = time.monotonic()
        took = now - self._since.get(simulation, now)
        before = self._durations.get(simulation, took)
        self._since[simulation] = now
        self._durations[simulation] = before + _WEIGHT * (took - before)

    def forget(self, simulation: str) -> None:
        """Forget a simulation that is gone."""
        self._since.pop(simulation, None)
        self._durations.pop(simulation, None)

    def count_for(self, simulation: str, *, waiting: int, simulations: int) -> int:
        """Compute how many trials a simulation should have.

        `waiting` is the number of trials that wait or that this simulation holds; `simulations` is the number of
        simulations in the run.
        """
        duration = self._durations.get(simulation)
        if duration is None:
            return 1
        # Towards the end, each simulation gets fewer trials, so that all have work until the end.
        share = math.ceil(waiting / (2 * max(simulations, 1)))
        # Two episodes may arrive together, with no time between them, so a duration counts as 1 ms at least.
        return max(1, min(_MOST, share, math.ceil(_AHEAD_S / max(duration, 1e-3))))
