"""Rounds of 64 trials, by which a plan grows while it is collected.

The configuration and the results of rounds up to r - 2 determine whether there is a round r, and its trials. Round r is
drawn only when all these rounds have ended, so the order in which results arrive does not matter; and while the last
trials of a round end, simulations are busy with the next round. The first two rounds depend on no results.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.sweep.plan import FIRST_TRIALS, ROUND_TRIALS
from throwcollect.sweep.points import Points
from throwcollect.sweep.rows import Rows
from throwcollect.sweep.samplers import draw_points
from throwcollect.sweep.trials import Trials
from throwcollect.tasks.result import Result

if TYPE_CHECKING:
    from throwcollect.sweep.target_sampler import TargetSampler

_FIRST_ROUNDS = FIRST_TRIALS // ROUND_TRIALS
_TOLERANCE = 1e-9
"""Values that are drawn again on another machine may differ in their last bits; relative, but absolute near 0."""


def find_same(planned: NDArray[np.float64], drawn: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the values of a plan that are the same when they are drawn again; all three arrays have one shape."""
    return np.isclose(planned, drawn, rtol=_TOLERANCE, atol=_TOLERANCE)


class Rounds:
    """The rounds of the plan of a configuration that grows.

    Raises:
        PlanError: If nothing is swept, or `trials` does not fit the sampler.
    """

    def __init__(self, config: Config) -> None:
        self._points = draw_points(config, directory=Path())
        self._wanted = config.until.wanted if config.until else None
        self._success = config.task.success
        self._sampler = _make_target_sampler(config)
        targets = self._sampler.dimensions if self._sampler else 0
        self._values = Rows(np.empty((0, len(self._points.keys))))
        self._places = Rows(np.empty((0, targets)))
        self._waiting = bytearray()
        """For each trial, 1 until its result is known."""
        self._succeeded = bytearray()
        """For each trial, 1 if it is known to be a success."""
        self._ended = 0
        """Number of rounds, from the first one on, with all results known."""
        self._succeeded_in_ended = 0

    @property
    def limit(self) -> int:
        """Largest number of trials that the plan may reach."""
        return len(self._points.values)

    @property
    def planned(self) -> int:
        """Number of trials in the plan."""
        return len(self._waiting)

    @property
    def over(self) -> bool:
        """Whether no trial will follow."""
        if self.planned >= self.limit:
            return True
        # Only decisive rounds count, because otherwise the end would depend on which results have arrived by now.
        return self._wanted is not None and self._decisive > 0 and self.due and self._succeeded_in_ended >= self._wanted

    @property
    def due(self) -> bool:
        """Whether all results that the next trials depend on are known."""
        decisive = self._decisive
        while self._ended < decisive:
            trials = slice(self._ended * ROUND_TRIALS, (self._ended + 1) * ROUND_TRIALS)
            if any(self._waiting[trials]):
                break
            self._succeeded_in_ended += sum(self._succeeded[trials])
            self._ended += 1
        return self._ended == decisive

    @property
    def _decisive(self) -> int:
        """Number of rounds whose results determine the next trials."""
        # The next round has the number r = `planned // ROUND_TRIALS`, and rounds 0 to r - 2 determine it.
        return max(0, self.planned // ROUND_TRIALS - 1)

    def add(self, trials: Trials) -> None:
        """Take in trials of the plan, which follow the trials that were taken in before."""
        self._values.append(trials.values)
        self._places.append(np.full((len(trials), self._places.all.shape[1]), np.nan))
        self._waiting += bytes(number not in trials.refused for number in trials.numbers)
        self._succeeded += bytes(len(trials))

    def take_result(self, number: int, result: Result) -> None:
        """Take in the result of a trial; a second result of the same trial changes nothing."""
        if not self._waiting[number]:
            return
        self._waiting[number] = False
        self._succeeded[number] = result.outcome.value == self._success
        if self._sampler is not None:
            values = dict(zip(self._points.keys, self._values.all[number].tolist(), strict=True))
            self._places.all[number] = self._sampler.place(values, result)

    def draw(self) -> Points:
        """Draw the points of the next trials, to the end of their round; call it only if `due` and not `over`.

        The sampler of `sweep.target` learns from round to round, so each round from the third on has to be drawn once,
        and in order.
        """
        number, present = divmod(self.planned, ROUND_TRIALS)
        if self._sampler is None or number < _FIRST_ROUNDS:
            return Points(self._points.keys, self._values_of(number)[present:])
        known = (number - 1) * ROUND_TRIALS
        values = self._sampler.draw(self._values_of(number), self._values.all[:known], self._places.all[:known])
        return Points(self._points.keys, values)

    def _values_of(self, number: int) -> NDArray[np.float64]:
        return self._points.values[number * ROUND_TRIALS : (number + 1) * ROUND_TRIALS]


def _make_target_sampler(config: Config) -> TargetSampler | None:
    if config.sweep.target is None:
        return None
    # Importing scipy.spatial takes about a second, so only plans that need it do so, and before the collection begins.
    from throwcollect.sweep.target_sampler import TargetSampler

    return TargetSampler(config, config.sweep.target, first=_FIRST_ROUNDS)
