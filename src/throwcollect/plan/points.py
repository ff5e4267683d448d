"""Points of a parameter space, which samplers draw and tables hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.task_config import is_target


@dataclass(frozen=True, eq=False)
class Points:
    """Values of the swept keys, and places where trials should end, on which no simulation depends; one row per trial.

    Attributes:
        names: Dotted configuration keys, then columns of targets that the task declares, ``(n_columns,)``.
        table: In the units of the names, NaN where a trial has no target, shape ``(n_trials, n_columns)``.
    """

    names: tuple[str, ...]
    table: NDArray[np.float64]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        return self.names == other.names and np.array_equal(self.table, other.table, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, rows: slice) -> Points:
        return Points(self.names, self.table[rows])

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Dotted configuration keys, ``(n_keys,)``."""
        return tuple(name for name in self.names if not is_target(name))

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the keys, shape ``(n_trials, n_keys)``."""
        return self.table[:, : len(self.keys)]

    @cached_property
    def target_names(self) -> tuple[str, ...]:
        """Columns of targets; empty if no trial has one."""
        return self.names[len(self.keys) :]

    @property
    def targets(self) -> NDArray[np.float64]:
        """Places where the trials should end, shape ``(n_trials, n_targets)``."""
        return self.table[:, len(self.keys) :]

    def row(self, number: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return the values of a row by key, and its target by column, without missing numbers."""
        numbers = dict(zip(self.names, self.table[number].tolist(), strict=True))
        target = {name: numbers.pop(name) for name in self.target_names}
        return numbers, {name: value for name, value in target.items() if not math.isnan(value)}
