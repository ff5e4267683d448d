"""Points of a parameter space, which samplers draw and tables hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Targets:
    """Places where trials should end, one row per trial; the simulation does not depend on them.

    Attributes:
        names: Columns of targets that the task declares, ``(n_targets,)``.
        values: In the units of their names, NaN where a trial has none, shape ``(n_trials, n_targets)``.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]

    def __getitem__(self, rows: slice) -> Targets:
        return Targets(self.names, self.values[rows])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Targets):
            return NotImplemented
        return self.names == other.names and np.array_equal(self.values, other.values, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]

    def row(self, number: int) -> dict[str, float]:
        """Return the target of a row by column, without missing values; empty if it has none."""
        pairs = zip(self.names, self.values[number].tolist(), strict=True)
        return {name: value for name, value in pairs if not math.isnan(value)}


@dataclass(frozen=True, eq=False)
class Points:
    """Values of the swept keys, one row per trial.

    Attributes:
        keys: Dotted configuration keys, ``(n_keys,)``.
        values: In the units of the keys, shape ``(n_trials, n_keys)``.
        targets: Places where the trials should end; None if no trial has one.
    """

    keys: tuple[str, ...]
    values: NDArray[np.float64]
    targets: Targets | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        return self.keys == other.keys and np.array_equal(self.values, other.values) and self.targets == other.targets

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, rows: slice) -> Points:
        return Points(self.keys, self.values[rows], self.targets and self.targets[rows])
