"""Columns of a table as points to plot, and fewer of them where more would show nothing new."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

MOST_POINTS = 5000
"""Points in one plot."""


def read_numbers(throws: pa.Table, name: str) -> NDArray[np.float64]:
    """A column of numbers, nan where there is none, shape ``(n_trials,)``."""
    return np.asarray(throws[name].to_numpy(), dtype=np.float64)


def choose_points(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Indices of the points to draw, in order: all, or as many as allowed, always the same ones.

    Args:
        count: Number of points.
        most: How many to draw.
    """
    if count <= most:
        return np.arange(count)
    # Every n-th point of a Sobol sequence or a grid lies on a lattice, which would look like a pattern in the data.
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))
