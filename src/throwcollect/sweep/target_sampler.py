"""The sampler of `sweep.target`, which spreads landing throws over the cells of landing targets."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Parameter
from throwcollect.config.sweep import TargetConfig
from throwcollect.sweep.inverse import InverseModel
from throwcollect.sweep.plan import ROUND_TRIALS
from throwcollect.sweep.samplers import places, spread
from throwcollect.sweep.target_cells import NOWHERE, CellChooser, Cells
from throwcollect.tasks.result import Result
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

_RANDOMNESS = 0
"""First number of the spawn keys of rounds, which have two numbers; those of trials have one."""
_GOALS = 3
"""Number of random places in a cell for each throw; it aims at the place to which it is predicted to come nearest."""


class TargetSampler:
    """Draws round after round, round r from the results of rounds up to r - 2.

    The points are a pure function of the configuration and these results: a new sampler that gets the same results from
    the first round on draws the same points. `first` is the number of the first round that it draws.
    """

    def __init__(self, config: Config, target: TargetConfig, *, first: int) -> None:
        self._next_round = first
        """Number of the round that `draw` draws next."""
        self._seed = config.seed
        self._parameters: Mapping[str, Parameter] = config.sweep.parameters
        self._cells = Cells(target)
        self._model = InverseModel(len(self._parameters), self.dimensions)
        self._aims = np.full(first * ROUND_TRIALS, NOWHERE)
        """Cells of the throws whose results `draw` does not know yet."""
        self._known = 0
        """Number of trials whose results `draw` knows."""
        self._landed = np.zeros(self._cells.count, dtype=np.int64)
        self._missed = np.zeros(self._cells.count, dtype=np.int64)
        """For each cell, how many throws at it landed elsewhere or not at all, since the last landing in it."""

    @property
    def dimensions(self) -> int:
        """Number of targets."""
        return len(self._cells.shape)

    def place(self, values: Mapping[str, float], result: Result) -> NDArray[np.float64]:
        """Find the landing place of a trial for `draw`, in bins, shape ``(n_targets,)``; NaN if it did not land."""
        if not isinstance(result, ThrowResult) or result.outcome is not ThrowOutcome.LANDED:
            return np.full(self.dimensions, np.nan)
        return self._cells.place(values, result)

    def draw(
        self, otherwise: NDArray[np.float64], tried: NDArray[np.float64], ended: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Draw the points of the next round.

        Args:
            otherwise: Points to return while too few throws have landed, shape ``(n_trials, n_parameters)``: a whole
                round, or fewer trials if it is the last round.
            tried: Values of the trials of all rounds but the latest, shape ``(n_tried, n_parameters)``; the first rows
                are those of the previous call.
            ended: The result of `place` for each of these trials, shape ``(n_tried, n_targets)``.

        Returns:
            Values in the units of the parameters, shape ``(n_trials, n_parameters)``.
        """
        key = (_RANDOMNESS, self._next_round)
        randomness = np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=key))
        self._next_round += 1
        self._learn(self._to_unit_cube(tried[self._known :]), ended[self._known :])
        if not self._model.usable:
            self._aims = np.append(self._aims, np.full(ROUND_TRIALS, NOWHERE))
            return otherwise
        chooser = self._score_cells(randomness)
        aims = np.empty(0, dtype=np.int64)
        unit = np.empty((0, tried.shape[1]))
        # The loop ends, because a cell without a promising throw is given back only once; then its throw is taken.
        while len(aims) < ROUND_TRIALS:
            cells = chooser.take(ROUND_TRIALS - len(aims))
            corners = self._cells.corners(cells)[:, np.newaxis]
            places_inside = randomness.random((len(cells), _GOALS, self.dimensions))
            proposed, promising = self._model.propose(corners + places_inside, randomness)
            given_back = np.zeros(len(cells), dtype=np.bool_)
            given_back[~promising] = chooser.give_back(cells[~promising])
            aims = np.append(aims, cells[~given_back])
            unit = np.append(unit, proposed[~given_back], axis=0)
        self._aims = np.append(self._aims, aims)
        columns = [spread(parameter, unit[:, i]) for i, parameter in enumerate(self._parameters.values())]
        # A short round has the first points of a whole round, so that a plan can be made longer later.
        return np.column_stack(columns)[: len(otherwise)]

    def _learn(self, tried: NDArray[np.float64], ended: NDArray[np.float64]) -> None:
        """Take in the results of further trials, whose parameters are places in the unit cube."""
        # Results arrive in order of trials, so the first aims are those of the trials that have ended.
        aimed, self._aims = self._aims[: len(ended)], self._aims[len(ended) :]
        self._known += len(ended)
        landed = np.isfinite(ended[:, 0])
        self._model.learn(tried, landed, ended[landed])
        for aim, cell in zip(aimed, self._cells.cells_of(ended), strict=True):
            if aim != NOWHERE:
                self._missed[aim] += 1
            if cell != NOWHERE:
                self._landed[cell] += 1
                self._missed[cell] = 0

    def _score_cells(self, randomness: np.random.Generator) -> CellChooser:
        """Make the current scores of the cells; `randomness` decides between equal scores."""
        cells = self._cells.count
        return CellChooser(
            landed=self._landed,
            asked=np.bincount(self._aims[self._aims != NOWHERE], minlength=cells),
            missed=self._missed,
            away=self._model.measure_distances(self._cells.corners(np.arange(cells)) + 0.5),
            randomness=randomness,
        )

    def _to_unit_cube(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([places(each, values[:, i]) for i, each in enumerate(self._parameters.values())])
