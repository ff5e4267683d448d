"""The progress of a collection, as the coordinator publishes it (see `ros.nodes.coordinator.showing`)."""

from __future__ import annotations

import json
import time
from collections import deque
from dataclasses import asdict, dataclass

from pydantic import TypeAdapter, ValidationError

from throwcollect.wording import format_count


@dataclass(frozen=True)
class Progress:
    """The state of a collection; each message has all of it, so that a subscriber may join late.

    Attributes:
        total: Number of trials to run; with `wanted`, of those that are known so far.
        ended: Number of trials that have ended.
        outcomes: Number of trials of each outcome.
        simulations: Number of simulations in the ROS graph.
        throws_per_s: Trials that ended per second of the last ten seconds.
        hung: Names of the simulations that took too long for a trial and have not been heard of since.
        wanted: Number of trials that are to succeed; None if the collection ends with its plan.
        success: Outcome of trials that succeeded.
        noun: Word for a trial.
    """

    total: int
    ended: int
    outcomes: dict[str, int]
    simulations: int
    throws_per_s: float
    hung: list[str]
    wanted: int | None = None
    success: str = "landed"
    noun: str = "throw"

    @property
    def succeeded(self) -> int:
        """Number of trials that succeeded."""
        return self.outcomes.get(self.success, 0)

    @property
    def lost(self) -> int:
        """Number of trials that were given up."""
        return self.outcomes.get("lost", 0)

    @property
    def failed(self) -> int:
        """Number of trials with any other outcome."""
        return sum(self.outcomes.values()) - self.succeeded - self.lost

    @property
    def steps(self) -> tuple[int, int]:
        """Number of trials done and to do; of those that succeed, if the collection ends with a number of them."""
        if self.wanted is None:
            return self.ended, self.total
        return min(self.succeeded, self.wanted), self.wanted

    @property
    def counts(self) -> str:
        """Trials that succeeded and that failed, simulations and speed, in one line."""
        return ", ".join([f"{self.succeeded} {self.success}", *self._others])

    @property
    def line(self) -> str:
        """The progress in one line, for people."""
        if self.wanted is None:
            return f"{self.ended}/{format_count(self.total, self.noun)}: {self.counts}"
        succeeded = f"{self.succeeded}/{self.wanted} {self.success}"
        return f"{format_count(self.ended, self.noun)}: {', '.join([succeeded, *self._others])}"

    @property
    def _others(self) -> list[str]:
        lost = [f"{self.lost} lost"] if self.lost else []
        simulations = format_count(self.simulations, "simulation")
        return [f"{self.failed} failed", *lost, simulations, f"{self.throws_per_s:.1f} {self.noun}s/s"]

    def to_json(self) -> str:
        """Write the progress as JSON, for `read`."""
        return json.dumps(asdict(self))

    @classmethod
    def read(cls, text: str) -> Progress | None:
        """Read progress from its JSON; None if the string is anything else, as any node may publish there."""
        try:
            return _PROGRESS.validate_json(text, strict=True)
        except ValidationError:
            return None


_PROGRESS = TypeAdapter(Progress)


class TrialRate:
    """Trials that ended per second of real time, over a time until now; the first `ended` trials do not count."""

    def __init__(self, ended: int = 0, *, window_s: float = 10.0) -> None:
        self._window_s = window_s
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
        while self._ends[0][0] < now - self._window_s:
            self._ends.popleft()
