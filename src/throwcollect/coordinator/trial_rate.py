"""How many trials end in a second."""

from __future__ import annotations

import time
from collections import deque

_WINDOW_S = 10.0
"""Trials per second are averaged over this time."""


class TrialRate:
    """Trials that ended per second of real time, over the last ten seconds; the first `ended` trials do not count."""

    def __init__(self, ended: int = 0) -> None:
        # Pairs of a time and the number of trials that had ended by then. One pair is there from the start, so that a
        # rate can be taken from the first call of `note` on.
        self._ends = deque([(time.monotonic(), ended)])

    @property
    def per_s(self) -> float:
        """Trials that ended per second, as of the last call of `note`."""
        (since, before), (now, ended) = self._ends[0], self._ends[-1]
        return (ended - before) / (now - since) if now > since else 0.0

    def note(self, ended: int) -> None:
        """Note the number of trials that have ended by now."""
        now = time.monotonic()
        self._ends.append((now, ended))
        while self._ends[0][0] < now - _WINDOW_S:
            self._ends.popleft()
