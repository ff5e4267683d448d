"""Finds nearest neighbours among points, to which points can be appended without sorting all of them again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.extras import lazily
from throwcollect.sweep.rows import Rows

spatial = lazily("scipy.spatial")

_FEW = 1 << 16
"""Most points of the smallest tree. It is made again whenever points are appended, which takes some milliseconds."""
_GROWTH = 8


class Neighbours:
    """Points in order, and a search for the points that are near a place.

    The points lie in a few trees of consecutive points, each several times as large as the next one: when points are
    appended, most often only the smallest tree is made again. Which trees there are depends only on the number of
    points.
    """

    def __init__(self, dimensions: int) -> None:
        self._points = Rows(np.empty((0, dimensions)))
        self._trees: dict[tuple[int, int], Any] = {}

    @property
    def points(self) -> NDArray[np.float64]:
        """All points, shape ``(n_points, n_dimensions)``."""
        return self._points.all

    def append(self, points: NDArray[np.float64]) -> None:
        """Append points, shape ``(n_added, n_dimensions)``."""
        self._points.append(points)
        known, self._trees = self._trees, {}
        for first, stop in _list_spans(len(self.points)):
            tree = known.get((first, stop))
            self._trees[first, stop] = spatial.cKDTree(self.points[first:stop]) if tree is None else tree

    def find(self, places: NDArray[np.float64], count: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Find the points that are nearest to some places; the first of equally near points in different trees.

        Args:
            places: Shape ``(n_places, n_dimensions)``.
            count: Number of points to find for each place.

        Returns:
            Their distances, nearest first, and their indices; both of shape ``(n_places, count)``, with fewer columns
            if there are fewer points.
        """
        distances, indices = [], []
        for (first, stop), tree in self._trees.items():
            # Given the list 1, 2, ... in place of the number of neighbours, SciPy keeps the second axis even for one.
            far, which = tree.query(places, range(1, min(count, stop - first) + 1))
            distances.append(far)
            indices.append(which + first)
        if len(distances) == 1:
            return distances[0], indices[0]
        far, which = np.concatenate(distances, axis=1), np.concatenate(indices, axis=1)
        # A stable order takes the earlier tree where distances are equal, on every machine.
        nearest = np.argsort(far, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(far, nearest, axis=1), np.take_along_axis(which, nearest, axis=1)


def _list_spans(count: int) -> Iterator[tuple[int, int]]:
    """List the number of the first point of each tree, and the number after its last point, the largest tree first."""
    size = _FEW
    while size * _GROWTH <= count:
        size *= _GROWTH
    first = 0
    while first < count:
        # The last points, fewer than `_FEW`, have a tree of their own.
        stop = count if size < _FEW else count - (count - first) % size
        if stop > first:
            yield first, stop
        first, size = stop, size // _GROWTH
