"""What a report measures of throws: landings and how evenly they cover the plane, flights, and examples."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.sweep import LANDING_HEIGHT, TargetConfig
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.progress_log import log_progress
from throwcollect.report.maps import Points
from throwcollect.report.measured import read_numbers
from throwcollect.report.outcomes import Outcomes
from throwcollect.tasks.throw.flight import flight_residual

MOST_RESIDUALS = 2000
"""Most episodes whose flight is computed again, which takes some 15 s; `verify` computes the flights of all."""
_MOST_LANDED = 6
_MOST_OTHERS = 3
_BINS = 14
_TITLES = {
    "distance_m": ("landing distance", "landing distance [m]"),
    "hit_angle_rad": ("hit angle", "hit angle below the horizontal [°]"),
    "height_m": ("landing height", "landing height [m]"),
}
"""Name of each dimension, and the label of its axis."""


@dataclass(frozen=True)
class Landings(Points):
    """All throws whose ball crossed the landing plane, of any outcome; each array has the shape ``(n,)``.

    Attributes:
        distance_m: Horizontal distance from the robot's base [m].
        hit_angle_rad: Direction of flight below the horizontal [rad].
        elevation_rad: Direction of flight at release above the horizontal [rad].
    """

    distance_m: NDArray[np.float64]
    hit_angle_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]

    @property
    def elevation_deg(self) -> NDArray[np.float64]:
        """Direction of flight at release above the horizontal [°], as figures show it."""
        return np.degrees(self.elevation_rad)


def read_landings(throws: pa.Table, outcomes: Outcomes) -> Landings:
    """Read the landings of a table of throws."""
    x, y = read_numbers(throws, "landing_x_m"), read_numbers(throws, "landing_y_m")
    landings = Landings(
        row=np.arange(len(throws)),
        trial=np.asarray(throws["trial"].to_numpy()),
        x_m=x,
        y_m=y,
        distance_m=np.hypot(x, y),
        hit_angle_rad=read_numbers(throws, "hit_angle_rad"),
        speed_mps=read_numbers(throws, "release_speed_mps"),
        elevation_rad=read_numbers(throws, "release_elevation_rad"),
        code=outcomes.codes,
    )
    return landings[np.isfinite(x + y)]


@dataclass(frozen=True)
class CellAxis:
    """One dimension of the cells.

    Attributes:
        name: Its name.
        label: Label of its axis: the name, how it is measured, and the unit.
        edges: Edges of its bins, shape ``(n_bins + 1,)``.
    """

    name: str
    label: str
    edges: NDArray[np.float64]


@dataclass(frozen=True)
class Coverage:
    """Throws that landed, in cells of targets.

    Attributes:
        axes: One to three dimensions.
        counts: Number of throws in each cell; an array with one dimension for each axis.
        throws: Number of throws that landed, in a cell or not.
        configured: Whether the cells are those of the configuration; else they span the values of the throws.
    """

    axes: tuple[CellAxis, ...]
    counts: NDArray[np.intp]
    throws: int
    configured: bool

    @property
    def hit(self) -> int:
        """Number of cells with at least one throw."""
        return int((self.counts > 0).sum())

    @property
    def pairs(self) -> tuple[tuple[CellAxis, CellAxis, NDArray[np.intp]], ...]:
        """Each pair of axes, and the throws over both, shape ``(n_first, n_second)``, summed over the third."""
        numbers = set(range(len(self.axes)))
        return tuple(
            (self.axes[first], self.axes[second], self.counts.sum(axis=tuple(numbers - {first, second})))
            for first, second in combinations(sorted(numbers), 2)
        )


def count_throws(landings: Landings, throws: pa.Table, *, target: TargetConfig | None) -> Coverage | None:
    """Count throws that landed in the cells of the configuration's targets; None if none landed.

    Without targets, the cells span the values of the throws. The table is that of all throws.
    """
    if not len(landings):
        return None
    values = {"distance_m": landings.distance_m, "hit_angle_rad": np.degrees(landings.hit_angle_rad)}
    if target is None:
        edges = {name: _choose_edges(column) for name, column in values.items()}
    else:
        if target.height_m is not None:
            # The column has the heights of all trials, but only trials with landings matter here.
            values["height_m"] = read_numbers(throws, column_of(LANDING_HEIGHT))[landings.row]
        bins = target.dimensions
        values = {name: column for name, column in values.items() if name in bins}
        edges = {name: np.linspace(bins[name].min, bins[name].max, bins[name].bins + 1) for name in values}
        if "hit_angle_rad" in edges:
            # The configuration has radians, but the axis and the values above are in degrees.
            edges["hit_angle_rad"] = np.degrees(edges["hit_angle_rad"])
    counts, _ = np.histogramdd(np.column_stack(list(values.values())), list(edges.values()))
    axes = tuple(CellAxis(*_TITLES[name], edges[name]) for name in values)
    return Coverage(axes, counts.astype(np.intp), len(landings), target is not None)


def _choose_edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose edges of cells whose width is a round number, which people can quote."""
    low, high = float(values.min()), float(values.max())
    width = _round_up((high - low) / _BINS) or 0.1
    # There is one edge more, so that the largest value lies inside the last cell.
    first, last = np.floor(low / width), np.floor(high / width) + 1
    edges: NDArray[np.float64] = np.arange(first, last + 1) * width
    return edges


def _round_up(width: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten; to 0 if the width is too small to tell values apart."""
    if width < 1e-9:
        return 0.0
    power = 10.0 ** np.floor(np.log10(width))
    # The factor accepts a width that is a round number except for a rounding error.
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= width * (1 - 1e-9)))


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
    """Choose trials to look at: some that succeeded, by distance from near to far, and one of some other outcomes."""
    recorded = set(dataset.recorded.throws["trial"].to_pylist())
    by_distance = landed.trial[np.argsort(landed.distance_m, kind="stable")].tolist()
    usable = [trial for trial in by_distance if trial in recorded]
    picks = np.linspace(0, len(usable) - 1, min(len(usable), _MOST_LANDED)).round().astype(int)
    numbers = dataset["trial"]
    others = (
        next((trial for trial in numbers[outcomes.are(name)].tolist() if trial in recorded), None)
        for name in outcomes.names
        if name != outcomes.success
    )
    return (*(usable[pick] for pick in picks), *[trial for trial in others if trial is not None][:_MOST_OTHERS])
