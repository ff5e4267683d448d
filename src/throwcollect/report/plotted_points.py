"""Columns of a table as points to plot, and a choice of them if there are more than a plot can show."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

MOST_POINTS = 5000
"""Points in one plot."""


def read_numbers(throws: pa.Table, name: str) -> NDArray[np.float64]:
    """Read a column of numbers, nan for nulls, shape ``(n_trials,)``."""
    return np.asarray(throws[name].to_numpy(), dtype=np.float64)


def choose_points(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Choose indices of points to draw, in order: all, or `most` of them, always the same random choice."""
    if count <= most:
        return np.arange(count)
    # Every n-th point of a Sobol sequence or a grid lies on a lattice, which would look like a pattern in the data.
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))
