"""Extrema, means and deviations of columns that come in pieces (Chan, Golub and LeVeque, 1979)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Moments:
    """The moments of the rows of a table, which are read only once and need not fit into memory.

    All but the number of rows have one value a column; `squares` are sums of squared distances from the mean.
    """

    count: int
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def of(cls, rows: NDArray[np.float64]) -> Moments:
        """Compute the moments of some rows, shape ``(n_rows, n_columns)``, at least one."""
        # Sums run along memory, and their last bits depend on the order.
        rows = np.ascontiguousarray(rows)
        mean = rows.mean(axis=0)
        return cls(len(rows), rows.min(axis=0), rows.max(axis=0), mean, ((rows - mean) ** 2).sum(axis=0))

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations of the population, shape ``(n_columns,)``."""
        deviations: NDArray[np.float64] = np.sqrt(self.squares / self.count)
        return deviations

    def with_more(self, more: Moments) -> Moments:
        """Compute the moments of these rows and of those of `more` together."""
        count = self.count + more.count
        step = more.mean - self.mean
        return Moments(
            count,
            np.minimum(self.minimum, more.minimum),
            np.maximum(self.maximum, more.maximum),
            self.mean + step * (more.count / count),
            self.squares + more.squares + step**2 * (self.count * more.count / count),
        )
