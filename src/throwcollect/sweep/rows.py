"""An array that grows by rows, and seldom copies the rows that it already has."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

_Element = TypeVar("_Element", bound=np.generic)


class Rows(Generic[_Element]):
    """Rows of an array; on average, the cost of appending depends only on the number of appended rows.

    Args:
        rows: The first rows, shape ``(n_rows, ...)``; this array is never written to.
    """

    def __init__(self, rows: NDArray[_Element]) -> None:
        self._room: NDArray[_Element] = rows
        self._count = len(rows)

    @property
    def all(self) -> NDArray[_Element]:
        """All rows, shape ``(n_rows, ...)``; the returned array does not change when rows are appended."""
        return self._room[: self._count]

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows, shape ``(n_added, ...)``."""
        count = self._count + len(rows)
        if count > len(self._room):
            # With room for twice as many, a row is copied only a few times in all.
            room = np.empty((max(count, 2 * self._count), *self._room.shape[1:]), self._room.dtype)
            room[: self._count] = self.all
            self._room = room
        # Without new rows, the array may still be the caller's, which is never written to, and may be read-only.
        if count > self._count:
            self._room[self._count : count] = rows
        self._count = count
