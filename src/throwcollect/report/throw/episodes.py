"""The recordings that a report reads: departures from ballistic motion, and a few throws to look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset
from throwcollect.progress_log import log_progress
from throwcollect.report.outcomes import LANDED, Outcomes
from throwcollect.report.throw.landings import Landings
from throwcollect.tasks.throw.flight import flight_residual

MOST_RESIDUALS = 2000
"""Most episodes whose flight is computed again, which takes some 15 s; `verify` computes the flights of all."""
_MOST_LANDED = 6
_MOST_OTHERS = 3


@dataclass(frozen=True)
class Residuals:
    """How far recorded flights depart from ballistic motion.

    Attributes:
        episodes: Number of episodes in the dataset.
        checked: Number of episodes that were compared; if not all, they were chosen at random.
        distance_m: Largest distance of each flight that could be compared [m], shape ``(n,)``; nan if a sample is not a
            number.
    """

    episodes: int
    checked: int
    distance_m: NDArray[np.float64]

    @property
    def finite_m(self) -> NDArray[np.float64]:
        """The distances that are numbers [m]."""
        return self.distance_m[np.isfinite(self.distance_m)]


def measure_residuals(dataset: Dataset) -> Residuals:
    """Compare flights with ballistic motion, at most `MOST_RESIDUALS` of them."""
    trials = dataset.recorded.throws["trial"].to_numpy()
    # Episodes are chosen at random, as every n-th point of a Sobol sequence or a grid would lie on a lattice.
    chosen = np.sort(np.random.default_rng(0).permutation(trials)[:MOST_RESIDUALS])
    distances = []
    for trial in log_progress(chosen.tolist(), len(chosen), "flight", "compared"):
        throw = dataset.throw(trial)
        header, samples = throw.read_samples()
        distance = flight_residual(samples, header, config=dataset.config_of(throw))
        if distance is not None:
            distances.append(distance)
    return Residuals(len(trials), len(chosen), np.array(distances))


def choose_examples(dataset: Dataset, landed: Landings, outcomes: Outcomes) -> tuple[int, ...]:
    """Choose trials to look at: some that landed, from the nearest to the farthest, and one of some other outcomes."""
    recorded = set(dataset.recorded.throws["trial"].to_pylist())
    by_distance = landed.trial[np.argsort(landed.distance_m, kind="stable")].tolist()
    usable = [trial for trial in by_distance if trial in recorded]
    picks = np.linspace(0, len(usable) - 1, min(len(usable), _MOST_LANDED)).round().astype(int)
    numbers = dataset["trial"]
    others = (
        next((trial for trial in numbers[outcomes.are(name)].tolist() if trial in recorded), None)
        for name in outcomes.names
        if name != LANDED
    )
    return (*(usable[pick] for pick in picks), *[trial for trial in others if trial is not None][:_MOST_OTHERS])
