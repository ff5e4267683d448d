"""The distances by which trials miss their targets: columns of the table of throws, where trials have targets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.config.target import is_target
from throwcollect.config.values import leaves
from throwcollect.dataset.summary import MissSummary
from throwcollect.sweep.arrow_column import nan_where_null
from throwcollect.sweep.points import Targets
from throwcollect.units import unit_of_name


def read_targets(throws: pa.Table) -> Targets | None:
    """Read the targets of all trials of a table of throws, in order; None if it has no columns of targets."""
    names = tuple(name for name in throws.column_names if is_target(name))
    if not names:
        return None
    columns = [nan_where_null(throws[name].combine_chunks()) for name in names]
    return Targets(names, np.column_stack(columns))


def summarise_misses(config: Config, throws: pa.Table) -> dict[str, MissSummary]:
    """Summarise by how much trials missed their targets, by column of misses; empty if they have no targets.

    Args:
        config: Configuration of the dataset.
        throws: The table of throws, or some rows of it.
    """
    targets = read_targets(throws)
    if targets is None:
        return {}
    misses = Misses(config, targets.names)
    found = {}
    for name in misses.descriptions:
        columns = [number for number, each in enumerate(misses.targets) if each.miss == name]
        wanted = int((~np.isnan(targets.values[:, columns])).any(axis=1).sum())
        values = throws[name].drop_null().to_numpy()
        median, share90, largest = np.quantile(values, (0.5, 0.9, 1.0)).tolist() if len(values) else (None,) * 3
        found[name] = MissSummary(wanted, len(values), median, share90, largest)
    return found


class Misses:
    """Measures how far from their targets trials end.

    Attributes:
        targets: The columns of targets, as the task declares them.
        descriptions: What each column of misses is, by its name.

    Args:
        config: Configuration of the collection.
        targets: Names of its columns of targets.
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

        Args:
            target: Its target by column.
            row: Its row, with swept values and what was measured.
        """
        return {miss: self._measure(miss, target, row) for miss in self.descriptions}

    def _measure(self, miss: str, target: Mapping[str, float], row: Mapping[str, Any]) -> float | None:
        squares = 0.0
        wanted = [each for each in self.targets if each.miss == miss and each.name in target]
        for each in wanted:
            value = row.get(each.of, self._fixed.get(each.of))
            if value is None:
                return None
            squares += (value - target[each.name]) ** 2
        return math.sqrt(squares) if wanted else None
