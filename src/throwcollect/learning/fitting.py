"""Learns from the throws of a dataset where trials end."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import column_of, leaves
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.learning.arrays import Array
from throwcollect.learning.learned_map import Axis, KeyRole, Kind, LearnedMap, no_correction, scale_values
from throwcollect.learning.polynomial import Validation, cross_validate, fit_polynomial
from throwcollect.wording import format_count, suggest

EFFORT = "effort_peak_share"
"""Column of the largest share of a joint's torque limit."""
_THROWS_PER_PARAMETER = 3
_EFFORT_DEGREE = 2
_FOLDS = 5
_CELL = 0.05
"""Width of the cells of targets [m or rad]."""
_WORTH_KNOWING = 2.0
"""Latents are worth knowing if predictions without them are at least this many times worse."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A map that was learned, and how well it predicts.

    Attributes:
        learned: The map.
        trials: Numbers of the trials that it was learned from, shape ``(n,)``.
        ignored: Number of the dataset's throws that did not succeed.
        validation: How polynomials of several degrees predict throws that they were not fitted to.
        without_latents: Median error of predictions without latents as inputs; None if there are no latents.
    """

    learned: LearnedMap
    trials: NDArray[np.int64]
    ignored: int
    validation: Validation
    without_latents: float | None

    @property
    def error(self) -> float:
        """Median distance of a throw from its prediction by a polynomial that it was not fitted to [m or rad]."""
        return float(np.median(self.validation.best))

    @property
    def latents_count(self) -> bool:
        """Whether latents have an effect that is worth knowing."""
        return self.without_latents is not None and self.without_latents >= _WORTH_KNOWING * self.error


def fit_map(
    dataset: Dataset,
    *,
    kind: Kind = Kind.LOCAL,
    targets: Sequence[str] = (),
    parameters: Sequence[str] = (),
    context: Sequence[str] = (),
) -> Fit:
    """Learn from the trials of a dataset that succeeded.

    Args:
        dataset: The dataset, or a selection of its throws.
        kind: How predictions are made.
        targets: Columns that say where a trial ended; those of the task by default.
        parameters: Swept keys that are chosen when aiming; those of the task by default.
        context: Swept keys that are given with a target; those that the task names by default.
    """
    for argument, names in (("targets", targets), ("parameters", parameters), ("given", context)):
        if twice := [name for name in names if names.count(name) > 1]:
            raise ConfigError(f"{argument}: {twice[0]} is named twice", expected="each name once")
    if both := [key for key in parameters if key in context]:
        raise ConfigError(f"parameters and given: {both[0]} is in both", expected="each key in one of them")
    config = dataset.config
    columns = tuple(targets) or config.task.targets
    if not columns:
        raise ConfigError(
            f"the task {config.task.name} names no targets", expected="columns of the table of throws as targets"
        )
    throws = dataset.throws.filter(pc.equal(dataset.throws["outcome"], config.task.success))
    axes = _find_axes(dataset, throws, parameters, context)
    _check_amount(dataset, throws, axes)
    outputs = np.column_stack([_read_numbers(throws, column, dataset) for column in columns])
    values = np.column_stack([_read_numbers(throws, column_of(axis.key), dataset) for axis in axes])
    trials: NDArray[np.int64] = throws["trial"].to_numpy()
    fit = fit_throws(kind, axes, columns, values, outputs, _read_numbers(throws, EFFORT, dataset))
    return replace(fit, trials=trials, ignored=len(dataset) - len(throws))


def fit_throws(
    kind: Kind, axes: tuple[Axis, ...], targets: tuple[str, ...], values: Array, outputs: Array, efforts: Array
) -> Fit:
    """Learn from throws that succeeded.

    Args:
        kind: How predictions are made.
        axes: The inputs.
        targets: Columns that say where a trial ended.
        values: Inputs in the units of their keys, shape ``(n, n_axes)``.
        outputs: Where the trials ended, shape ``(n, n_targets)``.
        efforts: Largest shares of a joint's torque limit, shape ``(n,)``.
    """
    inputs, folds = scale_values(axes, values), _assign_folds(outputs)
    # Latents come last. Products of two latents have little effect, so such terms are left out.
    minor = sum(axis.role is KeyRole.LATENT for axis in axes)
    validation = cross_validate(inputs, outputs, folds, minor=minor)
    known = [axis.role is not KeyRole.LATENT for axis in axes]
    # The error of predictions without latents tells whether latents are worth knowing.
    blind = None if all(known) else float(np.median(cross_validate(inputs[:, known], outputs, folds).best))
    forward = fit_polynomial(inputs, outputs, validation.degree, minor=minor)
    effort = fit_polynomial(inputs, efforts[:, np.newaxis], min(_EFFORT_DEGREE, validation.degree))
    correction = no_correction(axes, targets)
    learned = LearnedMap(kind, axes, targets, forward, effort, values, outputs, efforts, correction)
    return Fit(learned, np.arange(len(inputs)), 0, validation, blind)


def count_needed_throws(parameters: int) -> int:
    """Smallest number of throws from which a model with this many parameters can be learned."""
    return _THROWS_PER_PARAMETER * (parameters + 1)


def number_cells(places: Array) -> NDArray[np.int64]:
    """Numbers of the cell of 5 cm or 0.05 rad that each place lies in, shape ``(n, n_targets)`` as the places."""
    return np.floor(places / _CELL).astype(np.int64)


def _find_axes(
    dataset: Dataset, throws: pa.Table, parameters: Sequence[str], context: Sequence[str]
) -> tuple[Axis, ...]:
    """List the swept keys as inputs: parameters, context, latents."""
    swept = dataset.plan.keys
    for key in (*parameters, *context):
        if key not in swept:
            raise ConfigError(f"{key} was not swept{suggest(key, swept)}")
    nominal = {leaf.name: leaf.value for leaf in leaves(dataset.config)}
    axes = []
    for key in swept:
        ends = pc.min_max(throws[column_of(key)]).as_py()
        low, high = ends["min"], ends["max"]
        role = _choose_role(dataset.config, key, parameters, context)
        # Nothing can be learned about a key with one value, and scaling would divide by zero. With a single throw, no
        # key varies; such a dataset is refused later, because it has too few throws.
        if low == high and len(throws) > 1:
            if key in (*parameters, *context):
                raise ConfigError(f"{key} has the value {low:g} in all throws", expected="a key that varies")
            continue
        axes.append(Axis(key, role, low, high, float(nominal[key])))
    # `LearnedMap.columns_of` relies on axes of the same role being side by side.
    return tuple(sorted(axes, key=lambda axis: list(KeyRole).index(axis.role)))


def _choose_role(config: Config, key: str, parameters: Sequence[str], context: Sequence[str]) -> KeyRole:
    if key in context or (not context and key in config.task.given):
        return KeyRole.CONTEXT
    chosen = key in parameters if parameters else key.startswith("task.")
    return KeyRole.PARAMETER if chosen else KeyRole.LATENT


def _check_amount(dataset: Dataset, throws: pa.Table, axes: tuple[Axis, ...]) -> None:
    """Refuse a dataset that no model can be learned from."""
    chosen = [axis.key for axis in axes if axis.role is KeyRole.PARAMETER]
    if not chosen:
        raise ConfigError(
            f"{dataset.directory}: no parameter of the task varies",
            expected="a sweep of task.… keys, or other parameters",
        )
    if len(throws) < (needed := count_needed_throws(len(chosen))):
        raise ConfigError(
            f"{dataset.directory}: {format_count(len(throws), dataset.config.task.noun)} of {len(dataset)} "
            f"{dataset.config.task.success}",
            expected=f"at least {needed} for {format_count(len(chosen), 'parameter')}",
        )


def _read_numbers(throws: pa.Table, column: str, dataset: Dataset) -> Array:
    """Read a column of finite numbers."""
    if column not in throws.column_names or not pa.types.is_floating(throws.schema.field(column).type):
        numbers = [field.name for field in throws.schema if pa.types.is_floating(field.type)]
        raise ConfigError(f"no column of numbers {column!r}{suggest(column, numbers, 'docs/dataset.md')}")
    values: Array = throws[column].to_numpy()
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        trial = throws["trial"][int(wrong[0])].as_py()
        raise DatasetError(f"{column} of trial {trial} is {values[wrong[0]]}", path=dataset.directory)
    return values


def _assign_folds(outputs: Array) -> NDArray[np.int64]:
    """Number of the fold of each throw; throws that ended in one cell are in one fold."""
    # A hash of the cell gives the fold, so that a throw stays in its fold when the dataset grows.
    numbers = [hashlib.sha256(cell.tobytes()).digest()[0] % _FOLDS for cell in number_cells(outputs)]
    if len(set(numbers)) < 2:
        # All throws ended in cells of one fold, so nothing would be left to learn from; now their order gives the fold.
        numbers = [number % _FOLDS for number in range(len(numbers))]
    return np.array(numbers, np.int64)
