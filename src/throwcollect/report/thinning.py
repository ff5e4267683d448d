"""Fewer points where more of them would show nothing new."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST_POINTS = 5000
"""Points in one plot."""


def thinned(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Indices of the points to draw, in order: all, or as many as allowed, always the same ones.

    Args:
        count: Number of points.
        most: How many to draw.
    """
    if count <= most:
        return np.arange(count)
    # Every n-th point of a Sobol sequence or a grid lies on a lattice, which would look like a pattern in the data.
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))
