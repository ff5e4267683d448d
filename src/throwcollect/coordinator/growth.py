"""Makes the further rounds of a plan that grows, piece by piece, while its trials are run."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

from throwcollect.config.values import with_values
from throwcollect.coordinator.prepare import feasibility_check
from throwcollect.sweep.plan import FIRST_TRIALS, ROUND_TRIALS, Check, Plan, make_trials, refusal
from throwcollect.sweep.rounds import Rounds, find_same
from throwcollect.sweep.trials import Trials
from throwcollect.tasks.result import Result


class EarlierRound(NamedTuple):
    """A round that an earlier collection has planned, and the results of its trials that are left, by number."""

    trials: Trials
    results: dict[int, Result]


class WrongTrials(NamedTuple):
    """Planned trials that are given up, because the results that are known now lead to others.

    Attributes:
        first: The first of these trials; all later ones are given up, too.
        episodes: How many of them have episodes, which are removed.
    """

    first: int
    episodes: int


class Growth:
    """The trials that a plan will still get.

    If an earlier collection has left a plan, only its first two rounds follow from the configuration alone. All later
    rounds follow from results, too, and trials that were lost may have other results when they are run again. So these
    rounds are drawn again. A round that comes out differently is given up if it was planned before all results were
    known that it depends on. If all were known, other versions of libraries make the difference, and the round stays.

    Args:
        plan: The plan so far.
        lost: Trials that were lost in an earlier collection.

    Raises:
        ConfigError: If the sweep cannot be drawn.
    """

    def __init__(self, plan: Plan, *, lost: Collection[int] = ()) -> None:
        self._config = plan.config
        self._earlier = plan.trials[:]
        self._results: dict[int, Result] = {}
        """Results of the earlier collection for trials that are not sure to belong to the plan."""
        self._wrong: WrongTrials | None = None
        self._first_anew = min(lost, default=math.inf)
        """The first trial whose result may not have been known when the earlier collection planned."""
        self._rounds = Rounds(plan.config)
        self._rounds.add(plan.trials[:FIRST_TRIALS])
        self._check: Check | None = None
        self._coming: Trials | None = None
        self._reasons: list[str | None] = []

    @property
    def planned(self) -> int:
        """Number of trials, from the first one on, that are sure to belong to the plan."""
        return self._rounds.planned

    @property
    def over(self) -> bool:
        """Whether no trial will follow."""
        return not self._doubtful and self._coming is None and self._rounds.over

    @property
    def most(self) -> int:
        """Number of trials that may follow at most."""
        return 0 if self.over else self._rounds.limit - self._rounds.planned

    @property
    def _doubtful(self) -> bool:
        """Whether the earlier collection has planned trials that are not drawn again yet."""
        return self._rounds.planned < len(self._earlier)

    def recall(self, trial: int, result: Result) -> None:
        """Take in a result that an earlier collection has left of a trial that is sure to belong to the plan."""
        self._rounds.take_result(trial, result)

    def take_result(self, trial: int, result: Result) -> None:
        """Take in the result of a trial that has ended now."""
        self._first_anew = min(self._first_anew, trial)
        self._rounds.take_result(trial, result)

    def keep(self, trial: int, result: Result) -> bool:
        """Keep a result that the earlier collection has left, unless its trial is sure to belong to the plan.

        Returns:
            Whether it is kept; `confirm` returns it later.
        """
        if trial < self._rounds.planned:
            return False
        self._results[trial] = result
        return True

    def confirm(self) -> EarlierRound | None:
        """Draw the next round of the earlier collection again.

        Returns:
            That round, whose trials are sure to belong to the plan from now on; None if there is none, if results are
            missing on which it depends, or if the results lead to another one (see `take_wrong`).
        """
        if not self._doubtful or not self._rounds.due:
            return None
        first = self._rounds.planned
        there = self._earlier[first : first + ROUND_TRIALS]
        drawn = None if self._rounds.over else self._rounds.draw()
        is_same = drawn is not None and find_same(there.values, drawn.values[: len(there)]).all()
        # A round depends on the results of all earlier rounds but the one right before it.
        if not is_same and self._first_anew < first - ROUND_TRIALS:
            self._give_up(first)
            if drawn is not None:
                self._coming = make_trials(self._config, drawn, first=first)
            return None
        self._rounds.add(there)
        # The last round of a plan that had fewer `trials` is completed by the same draw.
        if drawn is not None and len(there) < len(drawn.values):
            self._coming = make_trials(self._config, drawn[len(there) :], first=first + len(there))
        known = [number for number in there.numbers if number in self._results]
        return EarlierRound(there, {number: self._results.pop(number) for number in known})

    def take_wrong(self) -> WrongTrials | None:
        """Return the trials that were found not to belong to the plan, only once; None if there are none."""
        wrong, self._wrong = self._wrong, None
        return wrong

    def step(self) -> Trials | tuple[()] | None:
        """Do the next piece of work, of some milliseconds: draw a round, or check one of its trials.

        Returns:
            The trials of a round when it is ready, an empty tuple before that; None if there is nothing to do.
        """
        if self._coming is None:
            if self._doubtful or self._rounds.over or not self._rounds.due:
                return None
            self._coming = make_trials(self._config, self._rounds.draw(), first=self._rounds.planned)
            return ()
        if len(self._reasons) < len(self._coming):
            self._check = self._check or feasibility_check(self._config)
            trial = self._coming[len(self._reasons)]
            self._reasons.append(refusal(with_values(self._config, trial.values), self._check))
            return ()
        trials = self._coming.refuse(self._reasons)
        self._coming, self._reasons = None, []
        self._rounds.add(trials)
        return trials

    def _give_up(self, first: int) -> None:
        """Forget the trials that the earlier collection has planned, from the trial `first` on."""
        self._wrong = WrongTrials(first, len(self._results))
        self._earlier = self._earlier[:first]
        self._results.clear()
