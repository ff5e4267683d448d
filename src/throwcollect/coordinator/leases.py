"""Which trial goes to which simulation next: a state machine without clocks, network or files."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable
from itertools import islice

_MOST_IN_A_ROW = 3
"""After so many refused trials, and none that it could do, a simulation is doubted."""


class Leases:
    """Hands out trials and takes them back; every trial is completed or given up exactly once.

    A trial is *waiting*, then *held* by a simulation, then *delivered*: its episode is there but not checked yet. From
    there it is completed, or it waits again. Trials are handed out by number; one that comes back goes before all that
    are new, so that the dataset's open shards stay few, but not to a simulation that has failed with it, as long as
    there is another one.

    Some trials are refused by every simulation, and some simulations refuse every trial. So one that refuses is doubted
    at first: others get the trials. It is set aside for good when others could do what it refused.

    Args:
        trials: Numbers of the trials to do.
        retries: How often a trial may come back before it is given up.
    """

    def __init__(self, trials: Iterable[int], *, retries: int) -> None:
        self._fresh = deque(sorted(set(trials)))
        self._returned: list[int] = []
        self._retries = retries
        self._holders: dict[str, int] = {}
        self._delivered: dict[int, str] = {}
        self._failures: dict[int, list[tuple[str, str]]] = {}
        self._refusals: dict[str, list[tuple[int, str]]] = {}
        """Trials that a simulation has refused since it could do one, with the reasons."""
        self._wrong_refusals: dict[str, int] = {}
        """Number of trials that each simulation has refused and another one could do."""
        self._total = len(self._fresh)
        self._ended = 0
        self._completed = 0

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
        """Number of trials that are with a simulation, or delivered and not checked yet."""
        return len(self._holders) + len(self._delivered)

    @property
    def finished(self) -> bool:
        """Whether every trial was completed or given up."""
        return self._ended == self._total

    def why_set_aside(self, simulation: str) -> str | None:
        """Why a simulation gets no more trials: it has refused too many that others could do. None if it gets them."""
        if self._wrong_refusals.get(simulation, 0) < _MOST_IN_A_ROW:
            return None
        return self._refusals[simulation][-1][1]

    def hopeless(self, simulations: Collection[str]) -> str | None:
        """Why none of these simulations will ever do a trial: none ever did, and all refuse. None if there is hope."""
        if self._completed or not simulations or not all(map(self._is_doubted, simulations)):
            return None
        return self._refusals[min(simulations)][-1][1]

    def add(self, trials: Iterable[int]) -> None:
        """Take in further trials, with numbers above those that are there."""
        fresh = sorted(set(trials))
        self._fresh.extend(fresh)
        self._total += len(fresh)

    def upcoming(self, count: int) -> list[int]:
        """The trials that will be handed out next, at most so many."""
        return [*sorted(self._returned), *islice(self._fresh, count)][:count]

    def find_trial(self, simulation: str) -> int | None:
        """Trial that a simulation holds, or None."""
        return self._holders.get(simulation)

    def lease(self, simulation: str, *, others: Collection[str] = ()) -> int | None:
        """Give the next trial to a simulation.

        Args:
            simulation: Name of a simulation that holds no trial.
            others: Names of the other simulations that there are.

        Returns:
            Number of the trial, or None when none is waiting for it.

        Raises:
            ValueError: If the simulation still holds a trial.
        """
        if simulation in self._holders:
            raise ValueError(f"{simulation} still holds trial {self._holders[simulation]}")
        rivals = [other for other in others if other != simulation and not self._is_doubted(other)]
        if self.why_set_aside(simulation) is not None or (rivals and self._is_doubted(simulation)):
            return None
        trial = next((trial for trial in sorted(self._returned) if self._may_try(simulation, trial, rivals)), None)
        if trial is not None:
            self._returned.remove(trial)
        elif self._fresh:
            trial = self._fresh.popleft()
        else:
            return None
        self._holders[simulation] = trial
        return trial

    def recall(self, trial: int) -> None:
        """Count a trial as completed that was so before any was handed out.

        Raises:
            ValueError: If it does not wait to be handed out.
        """
        self._fresh.remove(trial)
        self._ended += 1

    def deliver(self, simulation: str, trial: int) -> bool:
        """A simulation handed in the episode of a trial, which is to be checked.

        Returns:
            Whether the simulation held that trial; an episode that comes too late is not wanted any more.
        """
        if self._holders.get(simulation) != trial:
            return False
        del self._holders[simulation]
        self._delivered[trial] = simulation
        return True

    def deliverer(self, trial: int) -> str:
        """Name of the simulation that has delivered a trial."""
        return self._delivered[trial]

    def complete(self, trial: int) -> None:
        """The episode of a delivered trial is as it should be."""
        simulation = self._delivered.pop(trial)
        self._refusals.pop(simulation, None)
        self._wrong_refusals.pop(simulation, None)
        for other, refused in self._refusals.items():
            wrong = sum(each == trial for each, _ in refused)
            self._wrong_refusals[other] = self._wrong_refusals.get(other, 0) + wrong
        self._ended += 1
        self._completed += 1

    def reject(self, trial: int, reason: str) -> list[str] | None:
        """The episode of a delivered trial is not as it should be; the trial goes back, or is given up.

        Args:
            trial: Number of the trial.
            reason: What is wrong with it, kept as evidence.

        Returns:
            All reasons when its retries are used up, else None.
        """
        return self._return(self._delivered.pop(trial), trial, reason, refused=True)

    def fail(self, simulation: str, reason: str, *, refused: bool = False) -> tuple[int, list[str]] | None:
        """A simulation was lost or could not do its trial; the trial goes back, or is given up.

        Args:
            simulation: Name of the simulation.
            reason: What happened, kept as evidence.
            refused: Whether the simulation refused the trial, so that it may refuse all others, too.

        Returns:
            The trial and all reasons when its retries are used up, else None.
        """
        trial = self._holders.pop(simulation, None)
        if trial is None:
            return None
        reasons = self._return(simulation, trial, reason, refused=refused)
        return None if reasons is None else (trial, reasons)

    def forget(self, simulation: str) -> None:
        """A simulation is gone; the next one of its name is another one."""
        self._refusals.pop(simulation, None)
        self._wrong_refusals.pop(simulation, None)

    def _is_doubted(self, simulation: str) -> bool:
        return len(self._refusals.get(simulation, ())) >= _MOST_IN_A_ROW

    def _may_try(self, simulation: str, trial: int, rivals: Collection[str]) -> bool:
        failed = {name for name, _ in self._failures[trial]}
        return simulation not in failed or failed.issuperset(rivals)

    def _return(self, simulation: str, trial: int, reason: str, *, refused: bool) -> list[str] | None:
        if refused:
            self._refusals.setdefault(simulation, []).append((trial, reason))
        failures = self._failures.setdefault(trial, [])
        failures.append((simulation, reason))
        if len(failures) <= self._retries:
            self._returned.append(trial)
            return None
        self._ended += 1
        if self._completed:
            # Nobody could do it, so that is the trial's fault.
            for name, refusals in self._refusals.items():
                self._refusals[name] = [each for each in refusals if each[0] != trial]
        return [f"{name}: {why}" for name, why in failures]
