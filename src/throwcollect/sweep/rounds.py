"""Rounds, by which a plan grows while it is collected: which trials come next, from results and nothing else.

A round has 64 trials. Whether there is a round r, and which trials are in it, depends on the configuration and on the
results of rounds up to r - 2, all of which have ended by then: while the last trials of a round end, simulations are
busy with the next one, and the order in which results arrive does not matter. The first two rounds depend on nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.sweep.plan import FIRST_TRIALS, ROUND_TRIALS, Trial
from throwcollect.sweep.points import Points
from throwcollect.sweep.samplers import draw_points
from throwcollect.tasks.result import Result

if TYPE_CHECKING:
    from throwcollect.sweep.target import TargetSampler

_FIRST_ROUNDS = FIRST_TRIALS // ROUND_TRIALS


class Rounds:
    """The rounds of one plan.

    Args:
        config: A configuration whose plan grows.

    Raises:
        PlanError: If nothing is swept, or `trials` does not fit the sampler.
    """

    def __init__(self, config: Config) -> None:
        self._points = draw_points(config, directory=Path())
        self._wanted = config.until.wanted if config.until else None
        self._success = config.task.success
        self._sampler = _target_sampler(config)
        targets = self._sampler.dimensions if self._sampler else 0
        self._trials: list[Trial] = []
        self._values = np.empty((0, len(self._points.keys)))
        self._places = np.empty((0, targets))
        self._waiting: set[int] = set()
        self._running: list[int] = []
        self._succeeded: list[int] = []

    @property
    def limit(self) -> int:
        """Number of trials that there may be at most."""
        return len(self._points.values)

    @property
    def planned(self) -> int:
        """Number of trials that there are."""
        return len(self._trials)

    @property
    def over(self) -> bool:
        """Whether no trial will follow."""
        if self.planned >= self.limit:
            return True
        before = self._decisive
        return self._wanted is not None and before > 0 and self.due and sum(self._succeeded[:before]) >= self._wanted

    @property
    def due(self) -> bool:
        """Whether every result that the next trials depend on is known."""
        return not any(self._running[: self._decisive])

    @property
    def _decisive(self) -> int:
        """Number of rounds whose results decide on the next trials."""
        return max(0, self.planned // ROUND_TRIALS - 1)

    def add(self, trials: Sequence[Trial]) -> None:
        """Take in trials that are in the plan.

        Args:
            trials: Numbered on from those that are there.
        """
        self._trials += trials
        self._values = np.vstack([self._values, [list(trial.values.values()) for trial in trials]])
        self._places = np.vstack([self._places, np.full((len(trials), self._places.shape[1]), np.nan)])
        for trial in trials:
            if trial.number % ROUND_TRIALS == 0:
                self._running.append(0)
                self._succeeded.append(0)
            if trial.refused is None:
                self._running[-1] += 1
                self._waiting.add(trial.number)

    def tell(self, number: int, result: Result) -> None:
        """Take in what came of a trial; a second result of the same trial changes nothing."""
        if number not in self._waiting:
            return
        self._waiting.remove(number)
        self._running[number // ROUND_TRIALS] -= 1
        self._succeeded[number // ROUND_TRIALS] += result.outcome.value == self._success
        if self._sampler is not None:
            self._places[number] = self._sampler.place(self._trials[number], result)

    def draw(self) -> Points | None:
        """Go a step further towards the next trials, which must be due, with `over` not true.

        Returns:
            Their points, to the end of a round; None if the step was to go through a round that is in the plan already.
        """
        number, there = divmod(self.planned, ROUND_TRIALS)
        if self._sampler is None or number < _FIRST_ROUNDS:
            return Points(self._points.keys, self._values_of(number)[there:])
        drawn = self._sampler.next_round
        known = (drawn - 1) * ROUND_TRIALS
        values = self._sampler.draw(self._values_of(drawn), self._values[:known], self._places[:known])
        return Points(self._points.keys, values[there:]) if drawn == number else None

    def _values_of(self, number: int) -> NDArray[np.float64]:
        return self._points.values[number * ROUND_TRIALS : (number + 1) * ROUND_TRIALS]


def _target_sampler(config: Config) -> TargetSampler | None:
    if config.sweep.target is None:
        return None
    # Importing scipy.spatial takes about a second, so only those who need it do, and not in the middle of a collection.
    from throwcollect.sweep.target import TargetSampler

    return TargetSampler(config, config.sweep.target, first=_FIRST_ROUNDS)
