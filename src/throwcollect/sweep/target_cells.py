"""Landing targets as a grid of cells, and the choice of the next cells to throw at."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.sweep import LANDING_HEIGHT, TargetConfig
from throwcollect.tasks.throw.throw_result import ThrowResult

NOWHERE = -1
"""Stands in place of the number of a cell where there is no cell."""

_TIE = 1e-6
"""Cells whose scores differ by less count as equal."""
_MOST_DOUBLINGS = 60
_GIVEN_BACK = 4
"""A cell that is given back counts as missed this many times more."""


class Cells:
    """The cells of landing targets; places are in units of their bins, so that each cell is a cube of side 1.

    Attributes:
        shape: Number of bins of each target, ``(n_targets,)``.
        count: Number of cells.
    """

    def __init__(self, target: TargetConfig) -> None:
        self._names = tuple(target.dimensions)
        dimensions = target.dimensions.values()
        self._low = np.array([dimension.min for dimension in dimensions])
        self._width = np.array([(dimension.max - dimension.min) / dimension.bins for dimension in dimensions])
        self.shape = tuple(dimension.bins for dimension in dimensions)
        self.count = math.prod(self.shape)

    def place(self, values: Mapping[str, float], result: ThrowResult) -> NDArray[np.float64]:
        """Find the landing place of a throw in bins, shape ``(n_targets,)``; NaN if it has no landing."""
        measured = dict.fromkeys(self._names, math.nan)
        if result.landing is not None and result.hit_angle_rad is not None:
            measured = {
                "distance_m": math.hypot(*result.landing.position[:2]),
                "height_m": values.get(LANDING_HEIGHT, math.nan),
                "hit_angle_rad": result.hit_angle_rad,
            }
        place: NDArray[np.float64] = (np.array([measured[name] for name in self._names]) - self._low) / self._width
        return place

    def cells_of(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Find the cell of each place, shape ``(n_places,)``; `NOWHERE` for places outside of all cells.

        Args:
            places: In bins, shape ``(n_places, n_targets)``; the upper end of the last bin is in it, NaN is in none.
        """
        shape = np.array(self.shape)
        inside = ((places >= 0) & (places <= shape)).all(axis=1)
        cells = np.full(len(places), NOWHERE, dtype=np.int64)
        bins = np.minimum(places[inside].astype(np.int64), shape - 1)
        cells[inside] = np.ravel_multi_index(tuple(bins.T), self.shape)
        return cells

    def corners(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Find the lower corner of each cell in bins, shape ``(n_cells, n_targets)``."""
        return np.column_stack(np.unravel_index(cells, self.shape)).astype(np.float64)


class CellChooser:
    """Chooses cells to throw at, each time the cell with the lowest score.

    The score of a cell is the number of throws that have landed in it or are planned, plus penalties for cells that
    seem out of reach: ``2^(missed - 1) - 1``, so that each further miss doubles the wait for the next try, and the
    square of the distance of the nearest landing beyond one bin, so that throws reach the cells at the edge of the
    region that they cover before those behind it.

    Args:
        landed: Throws that landed in each cell, shape ``(n_cells,)``.
        asked: Planned throws at each cell whose results are not known yet.
        missed: Throws at each cell that landed elsewhere or not at all, since the last landing in this cell.
        away: Distance of each cell's centre from the nearest landing [bins].
        randomness: Decides between cells with equal scores.
    """

    def __init__(
        self,
        *,
        landed: NDArray[np.int64],
        asked: NDArray[np.int64],
        missed: NDArray[np.int64],
        away: NDArray[np.float64],
        randomness: np.random.Generator,
    ) -> None:
        self._missed = missed
        self._given_back = np.zeros(len(missed), dtype=np.bool_)
        self._score = landed + asked + _penalise(missed) + np.maximum(away - 1, 0) ** 2
        # A throw counts 1, so this small number decides only between equal scores.
        self._score += _TIE * randomness.permutation(len(missed)) / len(missed)

    def take(self, count: int) -> NDArray[np.int64]:
        """Choose `count` cells, one after the other; a throw at a chosen cell counts as planned from then on."""
        taken = np.empty(count, dtype=np.int64)
        for index in range(count):
            taken[index] = np.argmin(self._score)
            self._score[taken[index]] += 1
        return taken

    def give_back(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Give back chosen cells without a promising throw; each then counts as missed `_GIVEN_BACK` times more.

        Returns:
            True for cells that are given back. A cell is given back only once: if `take` chooses it again, it stays
            chosen.
        """
        fresh = ~self._given_back[cells]
        # A cell may be listed more than once, and `-=` would subtract only once.
        np.subtract.at(self._score, cells[fresh], 1)
        returned = np.unique(cells[fresh])
        self._given_back[returned] = True
        self._score[returned] += _penalise(self._missed[returned] + _GIVEN_BACK) - _penalise(self._missed[returned])
        return fresh


def _penalise(missed: NDArray[np.int64]) -> NDArray[np.float64]:
    # `ldexp` computes exact powers of two on all machines; the bound keeps them finite.
    return np.ldexp(1.0, np.clip(missed - 1, 0, _MOST_DOUBLINGS)) - 1
