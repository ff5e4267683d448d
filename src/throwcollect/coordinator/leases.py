"""Which trial goes to which simulation next: a state machine without clocks, network or files."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable
from itertools import islice


class Leases:
    """Hands out trials and takes them back; every trial is completed or given up exactly once.

    Trials are handed out by number; one that comes back from a lost simulation goes before all that are new, so that
    the dataset's open shards stay few.

    Args:
        trials: Numbers of the trials to do.
        retries: How often a trial may come back before it is given up.
    """

    def __init__(self, trials: Iterable[int], *, retries: int) -> None:
        self._fresh = deque(sorted(set(trials)))
        self._returned: list[int] = []
        self._retries = retries
        self._holders: dict[str, int] = {}
        self._failures: dict[int, list[str]] = {}
        self._total = len(self._fresh)
        self._ended = 0

    @property
    def total(self) -> int:
        """Number of trials in all."""
        return self._total

    @property
    def ended(self) -> int:
        """Number of trials that were completed or given up."""
        return self._ended

    @property
    def leased(self) -> int:
        """Number of trials that are with a simulation."""
        return len(self._holders)

    @property
    def finished(self) -> bool:
        """Whether every trial was completed or given up."""
        return self._ended == self._total

    def add(self, trials: Iterable[int]) -> None:
        """Take in further trials, with numbers above those that are there."""
        fresh = sorted(set(trials))
        self._fresh.extend(fresh)
        self._total += len(fresh)

    def upcoming(self, count: int) -> list[int]:
        """The trials that will be handed out next, at most so many."""
        return [*sorted(self._returned), *islice(self._fresh, count)][:count]

    def held_by(self, simulation: str) -> int | None:
        """Trial that a simulation holds, or None."""
        return self._holders.get(simulation)

    def lease(self, simulation: str) -> int | None:
        """Give the next trial to a simulation.

        Args:
            simulation: Name of a simulation that holds no trial.

        Returns:
            Number of the trial, or None when none is waiting.

        Raises:
            ValueError: If the simulation still holds a trial.
        """
        if simulation in self._holders:
            raise ValueError(f"{simulation} still holds trial {self._holders[simulation]}")
        if not (self._returned or self._fresh):
            return None
        trial = heapq.heappop(self._returned) if self._returned else self._fresh.popleft()
        self._holders[simulation] = trial
        return trial

    def recall(self, trial: int) -> None:
        """Count a trial as completed that was so before any was handed out.

        Raises:
            ValueError: If it does not wait to be handed out.
        """
        self._fresh.remove(trial)
        self._ended += 1

    def complete(self, simulation: str, trial: int) -> bool:
        """A simulation handed in the episode of a trial.

        Returns:
            Whether the simulation held that trial; an episode that comes too late is not wanted any more.
        """
        if self._holders.get(simulation) != trial:
            return False
        del self._holders[simulation]
        self._ended += 1
        return True

    def fail(self, simulation: str, reason: str) -> tuple[int, list[str]] | None:
        """A simulation was lost or could not do its trial; the trial goes back, or is given up.

        Args:
            simulation: Name of the simulation.
            reason: What happened, kept as evidence.

        Returns:
            The trial and all reasons when its retries are used up, else None.
        """
        trial = self._holders.pop(simulation, None)
        if trial is None:
            return None
        reasons = self._failures.setdefault(trial, [])
        reasons.append(f"{simulation}: {reason}")
        if len(reasons) > self._retries:
            self._ended += 1
            return trial, reasons
        heapq.heappush(self._returned, trial)
        return None
