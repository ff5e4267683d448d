"""Covers a grid of landings evenly: chooses throws from where those that were collected so far have landed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Parameter, Range
from throwcollect.config.sweep import LANDING_HEIGHT, TargetConfig
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.learning.aiming import aim
from throwcollect.learning.learned_map import (
    EFFORT,
    Axis,
    KeyRole,
    LearnedMap,
    count_needed_throws,
    find_nearest,
    fit_throws,
    scale_values,
)
from throwcollect.learning.polynomial import Array
from throwcollect.plan.samplers import spread
from throwcollect.plan.trials import Points

Cells = NDArray[np.int64]

_NOWHERE = -1
_STARTS = 200
"""Number of throws, chosen at random for each batch, from which the search for new ones may start. With fewer, throws
into the same cell differ more; with more, a cell is found to be in reach more often."""
_NOISE = 0.3
"""Standard deviation of the distance between such a throw and the start, along each parameter, whose range has the
length 2: without it, most throws would be nearly the same as another one."""
_NEIGHBOURS = 8
"""Number of trials near a throw that show whether it is likely to fail."""
_RISK = 0.5
"""Largest share of these that may have failed, ..."""
_RISKY = 2
"""... but for so many throws at each cell in a round."""
_GROWTH = 3
"""Most throws that a cell may have at the end of a round, in multiples of those that have landed in it before."""
_PATIENCE = 20
"""How often no throw is found for a cell before it is given up until the next round; twice more for each that is."""
_LEAST_BATCH = 64
"""Fewest throws that are looked for at a time: for fewer, it would take as long."""
_NEAR_NOISE = 0.2
"""Standard deviation of the distance between a landing and the goal of a throw that should be like it [bins]."""
_NEAR_BINS = 1.0
"""A cell without landings is explored if the nearest landing is at most this far from its centre."""


class Grid:
    """The cells of landings that a configuration names; places are in bins, so that each cell is a cube of side 1.

    Attributes:
        names: Keys of `sweep.target`.
        shape: Number of bins of each.
    """

    def __init__(self, target: TargetConfig) -> None:
        bins = target.dimensions.values()
        self.names = tuple(target.dimensions)
        self.shape = tuple(each.bins for each in bins)
        self._low = np.array([each.min for each in bins])
        self._width = np.array([(each.max - each.min) / each.bins for each in bins])

    def measure(self, columns: Mapping[str, Array]) -> Array:
        """Find the places of landings from the columns of a table of throws, shape ``(n, n_names)``."""
        numbers = {
            "distance_m": np.sqrt(columns["landing_x_m"] ** 2 + columns["landing_y_m"] ** 2),
            "hit_angle_rad": columns["hit_angle_rad"],
            "height_m": columns.get(column_of(LANDING_HEIGHT), np.empty(0)),
        }
        places: Array = (np.column_stack([numbers[name] for name in self.names]) - self._low) / self._width
        return places

    def find_heights(self, places: Array) -> Array | None:
        """Find the heights of the landing plane [m] that places have; None if the grid has no heights."""
        if "height_m" not in self.names:
            return None
        column = self.names.index("height_m")
        heights: Array = self._low[column] + places[:, column] * self._width[column]
        return heights

    def find_cells(self, places: Array) -> Cells:
        """Find the number of the cell of each place, shape ``(n,)``; -1 for places outside of the grid."""
        bins = np.floor(places).astype(np.int64)
        inside = ((bins >= 0) & (bins < self.shape)).all(axis=1)
        cells = np.full(len(places), _NOWHERE)
        cells[inside] = np.ravel_multi_index(tuple(bins[inside].T), self.shape)
        return cells

    def find_corners(self, cells: Cells) -> Array:
        """Find the lower corner of each cell, shape ``(n, n_names)``."""
        return np.column_stack(np.unravel_index(cells, self.shape)).astype(np.float64)


def choose_throws(config: Config, datasets: Sequence[Dataset], *, count: int, number: int) -> Points:
    """Choose throws that should land in the cells of `sweep.target` in which few throws of all datasets have landed.

    Aiming chooses the keys of the task that have a range, and the height of the landing plane unless the cells have
    heights; the other keys are drawn from their ranges.

    Args:
        config: The configuration, with `sweep.target` and the parameters of the first dataset.
        datasets: The datasets so far, all of which sweep these parameters.
        count: Number of throws.
        number: Number of the dataset that the throws are for, from which the randomness follows.

    Returns:
        The throws: `count`, or fewer if not so many cells are in reach.
    """
    if config.sweep.target is None:
        raise ConfigError("sweep.target is missing", expected="the cells that throws should land in")
    parameters, grid = config.sweep.parameters, Grid(config.sweep.target)
    axes = _list_axes(config)
    keys = [column_of(axis.key) for axis in axes]
    measures = {"landing_x_m", "landing_y_m", "hit_angle_rad", column_of(LANDING_HEIGHT), EFFORT}
    names = {"outcome", *measures.intersection(datasets[0].throws.column_names), *keys}
    throws = pa.concat_tables([each.throws.select(sorted(names)) for each in datasets])
    values = np.column_stack([throws[key] for key in keys])
    outcomes, ends = throws["outcome"].to_numpy(), throws["landing_x_m"].to_numpy()
    landed = np.isin(outcomes.astype(str), [config.task.success, *config.task.informative]) & np.isfinite(ends)
    if not any(axis.role is KeyRole.PARAMETER for axis in axes) or landed.sum() < count_needed_throws(len(axes)):
        raise ConfigError(
            f"{landed.sum()} throws have landed",
            expected=f"at least {count_needed_throws(len(axes))}, and a key of the task that is swept",
        )
    columns = {name: throws[name].to_numpy()[landed] for name in measures.intersection(names)}
    places = grid.measure(columns)
    learned = fit_throws(axes, grid.names, values[landed], places, columns[EFFORT])
    randomness = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(number, 0)))
    found = _aim(learned, (values, ~landed), parameters, grid, count, randomness)
    if not len(found):
        raise ConfigError("sweep.target: none of its cells is in reach", hint="look at the report of the first round")
    return Points(tuple(parameters), found[:, [keys.index(column_of(key)) for key in parameters]])


def _list_axes(config: Config) -> tuple[Axis, ...]:
    """List what aiming chooses, and then what is drawn or given with a target."""
    axes = []
    given = config.sweep.target is not None and config.sweep.target.height_m is not None
    for key, parameter in config.sweep.parameters.items():
        bounds = (parameter.min, parameter.max) if isinstance(parameter, Range) else parameter.values
        low, high = min(bounds), max(bounds)
        may_be_aimed = key.startswith("task.") or (key == LANDING_HEIGHT and not given)
        aimed = may_be_aimed and isinstance(parameter, Range) and low < high
        role = KeyRole.PARAMETER if aimed else KeyRole.CONTEXT
        # An axis has a width, even if its key has one value.
        axes.append(Axis(key, role, low, high if low < high else low + 1.0, low))
    return tuple(sorted(axes, key=lambda axis: axis.role is KeyRole.CONTEXT))


def _find_promising(
    axes: tuple[Axis, ...], tried: Array, failed: NDArray[np.bool_], values: Array
) -> NDArray[np.bool_]:
    """Find the points near which at most half of the trials have failed; both in units of the axes, ``(n, n_axes)``."""
    inputs = scale_values(axes, tried)
    near = [find_nearest(((inputs - row) ** 2).sum(axis=1), _NEIGHBOURS) for row in scale_values(axes, values)]
    return np.array([failed[rows].mean() <= _RISK for rows in near], np.bool_)


def _aim(
    learned: LearnedMap,
    tried: tuple[Array, NDArray[np.bool_]],
    parameters: Mapping[str, Parameter],
    grid: Grid,
    count: int,
    randomness: np.random.Generator,
) -> Array:
    """Find throws into the emptiest cells, in the units of the axes, shape ``(n, n_axes)``.

    `tried` are all trials so far, and which of them have failed.
    """
    ends = grid.find_cells(learned.outputs)
    landed = np.bincount(ends[ends != _NOWHERE], minlength=math.prod(grid.shape))
    # In a cell at the edge, throws may fail that should land there, so their number grows from round to round.
    most = _GROWTH * landed + 2
    planned = landed.copy()
    missed = np.zeros(len(landed), np.int64)
    centres = grid.find_corners(np.arange(len(landed))) + 0.5
    # Throws at cells that are not near a landing would be wasted.
    squares = (((learned.outputs - centre) ** 2).sum(axis=1).min() for centre in centres)
    near = np.array([square <= _NEAR_BINS**2 for square in squares])
    rows_of = {cell: np.flatnonzero(ends == cell) for cell in np.unique(ends).tolist()}
    found: list[Array] = []
    while len(found) < count:
        open_cells = near & (missed < _PATIENCE + 2 * (planned - landed))
        cells = _choose_cells(planned, np.where(open_cells, most, 0), max(_LEAST_BATCH, count - len(found)))
        if not len(cells):
            break
        goals = grid.find_corners(cells) + randomness.random((len(cells), len(grid.names)))
        drawn = [
            spread(parameters[axis.key], randomness.random(len(cells))) for axis in learned.axes_of(KeyRole.CONTEXT)
        ]
        context = np.column_stack([np.empty((len(cells), 0)), *drawn])
        for index in np.flatnonzero((missed[cells] > 0) & (landed[cells] > 0)):
            # Only a part of this cell is in reach, so the throw should be similar to one that has landed there.
            like = randomness.choice(rows_of[cells[index]])
            moved = learned.outputs[like] + _NEAR_NOISE * randomness.standard_normal(len(grid.names))
            goals[index] = np.clip(moved, np.floor(learned.outputs[like]), np.floor(learned.outputs[like]) + 1 - 1e-9)
            context[index] = learned.values[like, learned.columns_of(KeyRole.CONTEXT)]
        if (heights := grid.find_heights(goals)) is not None:
            context[:, [axis.key for axis in learned.axes_of(KeyRole.CONTEXT)].index(LANDING_HEIGHT)] = heights
        starts = randomness.permutation(len(learned.values))[:_STARTS]
        # Later batches are for cells at the edge, which only what is known for sure leads to.
        spread_out = 0.0 if found else _NOISE
        noise = spread_out * randomness.standard_normal((len(starts), len(learned.axes_of(KeyRole.PARAMETER))))
        aims = aim(_start_from(learned, starts, noise), goals, learned.scale(KeyRole.CONTEXT, context))
        values = np.hstack([learned.unscale(KeyRole.PARAMETER, aims.parameters), context])
        predicted, safe = grid.find_cells(aims.predicted) == cells, _find_promising(learned.axes, *tried, values)
        for cell, inside, sure, row in zip(cells.tolist(), predicted.tolist(), safe.tolist(), values, strict=True):
            # At the edge of what is in reach, many throws have failed; some risk shows where the edge is.
            hit = inside and (sure or planned[cell] < landed[cell] + _RISKY)
            # The first throw at an empty cell goes as near to it as it can, so that the edge moves on.
            if hit or not (planned[cell] or missed[cell]):
                found.append(row)
            planned[cell] += hit
            missed[cell] += not hit
    return np.array(found[:count]).reshape(-1, len(learned.axes))


def _choose_cells(planned: Cells, most: Cells, count: int) -> Cells:
    """Choose the emptiest cells, one after the other; a chosen cell has one throw more."""
    score = planned.astype(np.float64)
    chosen = []
    for _ in range(count):
        score[score >= most] = np.inf
        cell = int(np.argmin(score))
        if score[cell] == np.inf:
            break
        chosen.append(cell)
        score[cell] += 1
    return np.array(chosen, np.int64)


def _start_from(learned: LearnedMap, throws: NDArray[np.intp], noise: Array) -> LearnedMap:
    """The same map, with which aiming starts near some of the throws; the noise is scaled, ``(n, n_parameters)``."""
    columns = learned.columns_of(KeyRole.PARAMETER)
    parameters = np.clip(learned.inputs[throws, columns] + noise, -1.0, 1.0)
    context = learned.inputs[throws, learned.columns_of(KeyRole.CONTEXT)]
    values = learned.values[throws].copy()
    values[:, columns] = learned.unscale(KeyRole.PARAMETER, parameters)
    # Where nothing has moved, the map predicts nothing better than what was measured.
    outputs = learned.predict_ends(parameters, context) if noise.any() else learned.outputs[throws]
    return learned.begin_from(values, outputs, learned.efforts[throws])
