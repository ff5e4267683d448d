"""Decides which trials belong to a dataset and which simulation gets which next, without clock, network or files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import chain

_OPEN, _SUCCEEDED, _FAILED = range(3)

_FRESH, _HANDED_OUT = 1, 2
_MOST_IN_A_ROW = 3
"""A simulation that refuses this many trials, without doing one in between, is doubted."""


@dataclass
class _Failure:
    """A simulation that did not do a trial; this does not count if it is alive, and only slow or cut off."""

    simulation: str
    reason: str
    counts: bool = True


class Leases:
    """Hands out trials and takes them back; every trial is completed or given up exactly once.

    A trial is *waiting*, then *held* by a simulation, until it is completed or waits again. A simulation does the
    trials that it holds in their order. Trials are handed out by number. A trial that comes back is handed out before
    all new ones, so that few shards of the dataset are open at a time. It does not go to a simulation that has failed
    with it, as long as there is another one. Any simulation may complete a trial, even if another one holds it by now,
    because a trial yields the same wherever it is done.

    Some trials are refused by every simulation, and some simulations refuse every trial. So a simulation that refuses
    several trials in a row is doubted: as long as there are others, these get the trials. It is set aside for good when
    others could do several of the trials that it refused.

    Args:
        trials: Numbers of the trials to do.
        retries: How often a trial may come back before it is given up; failures of living simulations do not count.

    Attributes:
        total: Number of trials in all.
        ended: Number of trials that were completed or given up.
    """

    def __init__(self, trials: Iterable[int], *, retries: int) -> None:
        self._open = bytearray()
        """For each number, `_FRESH`, `_HANDED_OUT`, or 0 if there is no such trial or it has ended; bytes, as there may
        be millions."""
        self._next = 0
        """No trial below this one is fresh."""
        self._waiting_fresh = 0
        self._returned: list[int] = []
        self._retries = retries
        self._held: dict[str, list[int]] = {}
        self._failures: dict[int, list[_Failure]] = {}
        self._missed: dict[str, int] = {}
        """Trials that simulations held which are out of sight, and may come back alive."""
        self._refusals: dict[str, list[tuple[int, str]]] = {}
        """Trials that a simulation has refused since it could do one, with the reasons."""
        self._wrong_refusals = Counter[str]()
        """How many of these another simulation could do."""
        self.total = 0
        self.ended = 0
        self._completed = 0
        self.add(trials)

    @property
    def leased(self) -> int:
        """Number of trials that are with a simulation."""
        return sum(map(len, self._held.values()))

    @property
    def waiting(self) -> int:
        """Number of trials that no simulation holds, and that are to be done."""
        return self._waiting_fresh + len(self._returned)

    def explain_hopelessness(self, simulations: Collection[str]) -> str | None:
        """Explain why none of these simulations will ever do a trial: none ever did, and all refuse. Else None."""
        if self._completed or not simulations or not all(map(self._is_doubted, simulations)):
            return None
        return self._refusals[min(simulations)][-1][1]

    def add(self, trials: Iterable[int]) -> None:
        """Take in further trials, with numbers above those that were handed out."""
        for trial in trials:
            # Numbers have gaps, because trials that the plan refuses are left out.
            self._open.extend(bytes(max(0, trial + 1 - len(self._open))))
            self._waiting_fresh += not self._open[trial]
            self.total += not self._open[trial]
            self._open[trial] = self._open[trial] or _FRESH

    def is_open(self, trial: int) -> bool:
        """Whether a trial of this number is to be done, and has not ended yet."""
        return 0 <= trial < len(self._open) and self._open[trial] > 0

    def find_held(self, simulation: str) -> tuple[int, ...]:
        """List the trials that a simulation holds, in their order."""
        return tuple(self._held.get(simulation, ()))

    def lease(self, simulation: str, *, others: Collection[str] = ()) -> int | None:
        """Give the next trial to a simulation; None if none waits for it. `others` are all simulations of the run."""
        # If all simulations are doubted, they all go on, because the trials may be to blame.
        rivals: list[str] = []
        if self._returned or self._refusals:
            rivals = [other for other in others if other != simulation and not self._is_doubted(other)]
        if self._wrong_refusals[simulation] >= _MOST_IN_A_ROW or (rivals and self._is_doubted(simulation)):
            return None
        trial = next((trial for trial in sorted(self._returned) if self._may_try(simulation, trial, rivals)), None)
        if trial is not None:
            self._returned.remove(trial)
        elif self._waiting_fresh:
            trial = self._next = self._open.index(_FRESH, self._next)
            self._take_fresh(trial)
        else:
            return None
        self._held.setdefault(simulation, []).append(trial)
        return trial

    def recall(self, trial: int) -> None:
        """Count a trial as completed that an earlier collection has completed."""
        self._take_fresh(trial)
        self._end(trial)

    def complete(self, simulation: str, trial: int) -> list[str]:
        """Note that a simulation has done an open trial, which it may hold, or have held before.

        Returns:
            The simulations that are set aside now, because they refused this trial and others.
        """
        # Nearly always, the simulation itself holds the trial.
        holder = next((name for name in chain((simulation,), self._held) if trial in self._held.get(name, ())), None)
        if holder is not None:
            self._drop(holder, trial)
        elif trial in self._returned:
            self._returned.remove(trial)
        else:
            self._take_fresh(trial)
        self._end(trial)
        self.forget(simulation)
        self._completed += 1
        wrong = [name for name, refused in self._refusals.items() if trial in dict(refused)]
        self._wrong_refusals.update(wrong)
        return [name for name in wrong if self._wrong_refusals[name] == _MOST_IN_A_ROW]

    def fail(
        self, simulation: str, trial: int, reason: str, *, refused: bool = False, alive: bool | None = False
    ) -> list[str] | None:
        """Take a trial back from a simulation that was lost or could not do it; let it wait again, or give it up.

        The reason is kept as evidence. With `refused`, the simulation refused the trial, and may refuse all others. If
        it is `alive`, this does not count; None if only a later call of `settle` decides it.

        Returns:
            All reasons when its retries are used up, else None.
        """
        self._drop(simulation, trial)
        if refused:
            self._refusals.setdefault(simulation, []).append((trial, reason))
        if alive is None:
            self._missed[simulation] = trial
        self._failures.setdefault(trial, []).append(_Failure(simulation, reason, counts=not alive))
        self._returned.append(trial)
        return self._give_up(trial)

    def settle(self, simulation: str, *, alive: bool) -> tuple[int, list[str]] | None:
        """Note what became of a simulation that was out of sight: it was alive, or it had ended.

        Returns:
            The trial that is given up now, and all reasons; None if there is none.
        """
        trial = self._missed.pop(simulation, None)
        if trial is None:
            return None
        failures = reversed(self._failures[trial])
        next(failure for failure in failures if failure.simulation == simulation).counts = not alive
        reasons = self._give_up(trial)
        return None if reasons is None else (trial, reasons)

    def _give_up(self, trial: int) -> list[str] | None:
        """Give up an open trial if its retries are used up, and no simulation that failed with it may be alive."""
        if not self.is_open(trial) or not self._is_used_up(trial) or trial in self._missed.values():
            return None
        self._returned.remove(trial)
        self._end(trial)
        # While no trial was ever done, refusals are kept whatever becomes of their trials: `_is_doubted` counts them.
        if self._completed:
            # No simulation could do the trial, so its refusals are not held against them.
            for name, refusals in self._refusals.items():
                self._refusals[name] = [(number, why) for number, why in refusals if number != trial]
        return [f"{failure.simulation}: {failure.reason}" for failure in self._failures[trial] if failure.counts]

    def release(self, simulation: str) -> None:
        """Take from a simulation all trials but the first, which runs; the others have not begun, so none failed."""
        held = self._held.get(simulation, [])
        self._returned += held[1:]
        del held[1:]

    def forget(self, simulation: str) -> None:
        """Forget the refusals of a simulation that is gone; a later one of the same name is a different one."""
        self._refusals.pop(simulation, None)
        self._wrong_refusals.pop(simulation, None)

    def _is_doubted(self, simulation: str) -> bool:
        return len(self._refusals.get(simulation, ())) >= _MOST_IN_A_ROW

    def _may_try(self, simulation: str, trial: int, rivals: Collection[str]) -> bool:
        failed = {failure.simulation for failure in self._failures.get(trial, ())}
        return not self._is_used_up(trial) and (simulation not in failed or failed.issuperset(rivals))

    def _is_used_up(self, trial: int) -> bool:
        return sum(failure.counts for failure in self._failures.get(trial, ())) > self._retries

    def _take_fresh(self, trial: int) -> None:
        self._open[trial] = _HANDED_OUT
        self._waiting_fresh -= 1

    def _end(self, trial: int) -> None:
        self._open[trial] = 0
        self.ended += 1

    def _drop(self, simulation: str, trial: int) -> None:
        held = self._held.get(simulation, [])
        held.remove(trial)
        if not held:
            self._held.pop(simulation, None)


class Prefix:
    """The first trials of a plan, up to the one at which enough trials have succeeded.

    A trial certainly belongs to the dataset if fewer than `wanted` of the trials before it have succeeded or may still
    succeed. Only such trials are run. So nothing runs that is not written, and the last trial depends neither on
    the number of simulations nor on the order in which results arrive.

    Args:
        numbers: Numbers of all trials of the plan.
        wanted: How many trials have to succeed; None if all trials belong to the dataset.
        refused: Trials that are known not to be run.
    """

    def __init__(self, numbers: range, *, wanted: int | None, refused: Collection[int]) -> None:
        self._first = numbers.start
        self._states = bytearray(len(numbers))
        for trial in refused:
            self._states[trial - self._first] = _FAILED
        self._wanted = math.inf if wanted is None else wanted
        self._count = 0
        """Number of trials that certainly belong to the dataset."""
        self._open = 0
        """How many of these have not ended yet."""
        self._possible = 0
        """How many of these have succeeded or may still succeed."""
        self._advance()

    @property
    def stop(self) -> int:
        """Number of the first trial that does not certainly belong to the dataset; it never gets smaller."""
        return self._first + self._count

    @property
    def complete(self) -> bool:
        """Whether all trials that certainly belong to the dataset have ended; then no other trial belongs to it."""
        return not self._open

    def end(self, trial: int, *, succeeded: bool) -> None:
        """Note how a trial has ended, or that it is refused; a second call for the same trial changes nothing."""
        place = trial - self._first
        if self._states[place] != _OPEN:
            return
        self._states[place] = _SUCCEEDED if succeeded else _FAILED
        if place < self._count:
            self._open -= 1
            self._possible -= not succeeded
            self._advance()

    def _advance(self) -> None:
        while self._possible < self._wanted and self._count < len(self._states):
            self._open += self._states[self._count] == _OPEN
            self._possible += self._states[self._count] != _FAILED
            self._count += 1
