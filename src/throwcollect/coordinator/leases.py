"""Decides which trial goes to which simulation next: a state machine without clocks, network or files."""

from __future__ import annotations

from collections.abc import Collection, Iterable

_MOST_IN_A_ROW = 3
"""A simulation that refuses this many trials, without doing one in between, is doubted."""


class Leases:
    """Hands out trials and takes them back; every trial is completed or given up exactly once.

    A trial is *waiting*, then *held* by a simulation, until it is completed or waits again. A simulation does the
    trials that it holds in their order. Trials are handed out by number. A trial that comes back is handed out before
    all new ones, so that few shards of the dataset are open at a time. It does not go to a simulation that has failed
    with it, as long as there is another one.

    Some trials are refused by every simulation, and some simulations refuse every trial. So a simulation that refuses
    trials is doubted at first: others get the trials. It is set aside for good when other simulations could do several
    of the trials that it refused.

    Args:
        trials: Numbers of the trials to do.
        retries: How often a trial may come back before it is given up.

    Attributes:
        total: Number of trials in all.
        ended: Number of trials that were completed or given up.
    """

    def __init__(self, trials: Iterable[int], *, retries: int) -> None:
        self._fresh = bytearray()
        """For each number, whether that trial has not been handed out yet; bytes, as there may be millions."""
        self._next = 0
        """No trial below this one is fresh."""
        self._waiting_fresh = 0
        self._returned: list[int] = []
        self._retries = retries
        self._held: dict[str, list[int]] = {}
        self._failures: dict[int, list[tuple[str, str]]] = {}
        self._refusals: dict[str, list[tuple[int, str]]] = {}
        """Trials that a simulation has refused since it could do one, with the reasons."""
        self._wrong_refusals: dict[str, int] = {}
        """Number of trials that each simulation has refused and another one could do."""
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

    @property
    def finished(self) -> bool:
        """Whether every trial was completed or given up."""
        return self.ended == self.total

    def why_set_aside(self, simulation: str) -> str | None:
        """Say why a simulation gets no more trials; None if it gets more."""
        if self._wrong_refusals.get(simulation, 0) < _MOST_IN_A_ROW:
            return None
        return f"it refused trials that other simulations could do: {self._refusals[simulation][-1][1]}"

    def explain_hopelessness(self, simulations: Collection[str]) -> str | None:
        """Say why none of these simulations will ever do a trial: none ever did, and all refuse. Else None."""
        if self._completed or not simulations or not all(map(self._is_doubted, simulations)):
            return None
        return self._refusals[min(simulations)][-1][1]

    def add(self, trials: Iterable[int]) -> None:
        """Take in further trials, with numbers above those that were handed out."""
        for trial in trials:
            # Numbers have gaps, because trials that the plan refuses are left out.
            self._fresh.extend(bytes(max(0, trial + 1 - len(self._fresh))))
            self._waiting_fresh += not self._fresh[trial]
            self.total += not self._fresh[trial]
            self._fresh[trial] = True

    def find_held(self, simulation: str) -> tuple[int, ...]:
        """List the trials that a simulation holds, in their order."""
        return tuple(self._held.get(simulation, ()))

    def lease(self, simulation: str, *, others: Collection[str] = ()) -> int | None:
        """Give the next trial to a simulation; None if none waits for it. `others` are all simulations of the run."""
        # If all simulations are doubted, they all go on, because the trials may be to blame.
        rivals = [other for other in others if other != simulation and not self._is_doubted(other)]
        if self.why_set_aside(simulation) is not None or (rivals and self._is_doubted(simulation)):
            return None
        trial = next((trial for trial in sorted(self._returned) if self._may_try(simulation, trial, rivals)), None)
        if trial is not None:
            self._returned.remove(trial)
        elif self._waiting_fresh:
            trial = self._next = self._fresh.index(True, self._next)
            self._take_fresh(trial)
        else:
            return None
        self._held.setdefault(simulation, []).append(trial)
        return trial

    def recall(self, trial: int) -> None:
        """Count a trial as completed that an earlier collection has completed.

        Raises:
            ValueError: If it does not wait to be handed out.
        """
        if not self._fresh[trial]:
            raise ValueError(trial)
        self._take_fresh(trial)
        self.ended += 1

    def complete(self, simulation: str, trial: int) -> None:
        """Note that a simulation has done a trial that it held.

        Raises:
            ValueError: If it does not hold the trial.
        """
        self._drop(simulation, trial)
        self._refusals.pop(simulation, None)
        self._wrong_refusals.pop(simulation, None)
        for other, refused in self._refusals.items():
            wrong = sum(number == trial for number, _ in refused)
            self._wrong_refusals[other] = self._wrong_refusals.get(other, 0) + wrong
        self.ended += 1
        self._completed += 1

    def fail(self, simulation: str, trial: int, reason: str, *, refused: bool = False) -> list[str] | None:
        """Take a trial back from a simulation that was lost or could not do it; let it wait again, or give it up.

        The reason is kept as evidence. With `refused`, the simulation refused the trial, and may refuse all others.

        Returns:
            All reasons when its retries are used up, else None.

        Raises:
            ValueError: If it does not hold the trial.
        """
        self._drop(simulation, trial)
        if refused:
            self._refusals.setdefault(simulation, []).append((trial, reason))
        failures = self._failures.setdefault(trial, [])
        failures.append((simulation, reason))
        if len(failures) <= self._retries:
            self._returned.append(trial)
            return None
        self.ended += 1
        # While no trial was ever done, refusals are kept whatever becomes of their trials: `_is_doubted` counts them.
        if self._completed:
            # No simulation could do the trial, so its refusals are not held against them.
            for name, refusals in self._refusals.items():
                self._refusals[name] = [(number, why) for number, why in refusals if number != trial]
        return [f"{name}: {why}" for name, why in failures]

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
        failed = {name for name, _ in self._failures.get(trial, ())}
        return simulation not in failed or failed.issuperset(rivals)

    def _take_fresh(self, trial: int) -> None:
        self._fresh[trial] = False
        self._waiting_fresh -= 1

    def _drop(self, simulation: str, trial: int) -> None:
        held = self._held.get(simulation, [])
        held.remove(trial)
        if not held:
            self._held.pop(simulation, None)
