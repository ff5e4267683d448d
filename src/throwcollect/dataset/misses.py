"""The distances by which trials miss their targets: columns of the table of throws, where trials have targets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.task_config import is_target
from throwcollect.config.values import column_of, leaves
from throwcollect.dataset.summary import MissSummary
from throwcollect.plan.arrow_column import nan_where_null
from throwcollect.units import unit_of_name


def read_targets(throws: pa.Table) -> dict[str, NDArray[np.float64]]:
    """Read the columns of targets of a table of throws, each ``(n_throws,)``, NaN where a trial has none, by name."""
    return {name: nan_where_null(throws[name].combine_chunks()) for name in throws.column_names if is_target(name)}


def summarise_misses(config: Config, throws: pa.Table) -> dict[str, MissSummary]:
    """Summarise by how much trials missed their targets, by column of misses; empty if they have no targets."""
    targets = read_targets(throws)
    misses = Misses(config, tuple(targets))
    summaries = {}
    for name in misses.descriptions:
        columns = [targets[each.name] for each in misses.targets if each.miss == name]
        aimed = int((~np.isnan(columns)).any(axis=0).sum())
        values = throws[name].drop_null().to_numpy()
        largest = float(values.max()) if len(values) else None
        summaries[name] = MissSummary(aimed, len(values), find_median(values), find_share90(values), largest)
    return summaries


class Misses:
    """Measures how far from their targets trials of a collection end.

    Attributes:
        targets: The columns of targets, as the task declares them.
        descriptions: Description of each column of misses, by its name.
    """

    def __init__(self, config: Config, targets: Sequence[str]) -> None:
        declared = {each.name: each for each in config.task.target_columns}
        self.targets = tuple(declared[name] for name in targets)
        keys = {each.of for each in self.targets}
        self._fixed = {leaf.name: leaf.value for leaf in leaves(config) if leaf.name in keys} if keys else {}
        names = dict.fromkeys(each.miss for each in self.targets)
        self.descriptions = {name: self._describe(name) for name in names}

    def _describe(self, miss: str) -> str:
        words = ", ".join(each.word for each in self.targets if each.miss == miss)
        return f"Distance of where the trial ended from its target, in {words} [{unit_of_name(miss)}]."

    def measure(self, target: Mapping[str, float], row: Mapping[str, Any]) -> dict[str, float | None]:
        """Compute the columns of misses of a trial; None where it has no such target, or nothing to compare with it.

        `target` has its target by column, and `row` its swept values and what was measured.
        """
        return {miss: self._measure(miss, target, row) for miss in self.descriptions}

    def _measure(self, miss: str, target: Mapping[str, float], row: Mapping[str, Any]) -> float | None:
        squares = 0.0
        columns = [column for column in self.targets if column.miss == miss and column.name in target]
        for column in columns:
            value = row.get(column_of(column.of), self._fixed.get(column.of))
            if value is None:
                return None
            squares += (value - target[column.name]) ** 2
        return math.sqrt(squares) if columns else None


def find_median(misses: Sequence[float] | NDArray[np.float64]) -> float | None:
    """Find the median; of an even number of misses, the mean of the middle two.

    Args:
        misses: Distances in any order; infinite for a trial that did not succeed, which so counts as farther than all.

    Returns:
        The median; None without misses, and where it depends on a trial that did not succeed.
    """
    median = float(np.median(misses)) if len(misses) else np.inf
    return median if np.isfinite(median) else None


def find_share90(misses: Sequence[float] | NDArray[np.float64]) -> float | None:
    """Find the miss that nine of ten stay below, linear between the two misses that are nearest to it in order.

    Arguments and result are as those of `find_median`.
    """
    if not len(misses):
        return None
    ordered = np.sort(np.asarray(misses, np.float64))
    farthest = ordered[-(-9 * (len(ordered) - 1) // 10)]
    # Larger misses do not count, but numpy would multiply the next one by 0, which is not a number if it is infinite.
    return float(np.quantile(np.minimum(ordered, farthest), 0.9)) if np.isfinite(farthest) else None
