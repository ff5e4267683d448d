"""Numbers of all throws of a dataset in one array whose columns have names and bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Bounds = tuple[float, float]
"""Smallest and largest value."""


def unknown_name(what: str, name: object, known: Iterable[str]) -> KeyError:
    """Make the error for a name of a column or a joint that does not exist, with those that do."""
    return KeyError(f"no {what} {name!r}; there are {', '.join(known)}")


def read_column(column: pa.ChunkedArray) -> NDArray[Any]:
    """Copy a column of a table into an array, one value a row; a number that is missing is NaN, a text None."""
    if pa.types.is_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    if column.null_count:
        column = column.cast(pa.float64()).fill_null(np.nan)
    return np.array(column.to_numpy())


@dataclass(frozen=True, eq=False, repr=False)
class NamedArray:
    """A table of numbers, one row a throw; NumPy takes it as its `values`.

    ``array["landing_x_m"]`` is one column, shape ``(n_throws,)``.

    Attributes:
        names: Names of the columns.
        values: Shape ``(n_throws, n_names)``, NaN where a throw has no such number; in SI units and radians.
        bounds: Smallest and largest value of each column, shape ``(n_names, 2)``.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    bounds: NDArray[np.float64]

    @classmethod
    def of(cls, table: pa.Table, names: Sequence[str], bounds: Sequence[Bounds]) -> NamedArray:
        """Take columns of a table, one row a throw, with smallest and largest value of each; None if there is none."""
        columns = [read_column(table[name]).astype(np.float64) for name in names]
        values = np.column_stack(columns) if columns else np.empty((len(table), 0))
        return cls(tuple(names), values, np.array(bounds, np.float64).reshape(-1, 2))

    # A loop could mean the rows as well as the names, so there is none.
    __iter__ = None

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return one column."""
        if name not in self.names:
            raise unknown_name("column", name, self.names)
        return self.values[:, self.names.index(name)]

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        values = self.values if dtype is None else self.values.astype(dtype)
        return values.copy() if copy else values

    def __repr__(self) -> str:
        ranges = (f"{name} {low:g} to {high:g}" for name, (low, high) in zip(self.names, self.bounds, strict=True))
        return f"NamedArray({len(self)} throws: {', '.join(ranges)})"
