"""Arrow columns of Python values, without what `pyarrow.array` does first: import pandas, wherever that is installed.

To import it takes 0.3 s of a processor, in each process that writes a table; nothing here uses it.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import accumulate
from math import isnan
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

_CODES = {pa.int64(): "q", pa.uint64(): "Q", pa.float64(): "d"}


def make_column(values: Sequence[Any] | NDArray[Any], kind: pa.DataType) -> pa.Array:
    """What ``pyarrow.array(values, kind)`` gives.

    Args:
        values: Numbers or texts; None for what is null. In an array, which must have the very kind, texts are bytes of
            one length, and nothing is null.
        kind: ``int64``, ``uint64``, ``float64`` or ``string``.

    Raises:
        TypeError: If a value is of another kind.
        OverflowError: If a number is too large, or the texts are longer than 2 GiB in all.
    """
    if isinstance(values, np.ndarray):
        return _make_array_column(values, kind)
    # The layout of Arrow's columnar format: a bitmap of what is there, then offsets and text, or numbers.
    nulls = sum(value is None for value in values)
    valid = np.packbits([value is not None for value in values], bitorder="little") if nulls else None
    if kind == pa.string():
        texts = [b"" if value is None else value.encode() for value in values]
        buffers = [array("i", accumulate(map(len, texts), initial=0)), b"".join(texts)]
    else:
        buffers = [array(_CODES[kind], [0 if value is None else value for value in values] if nulls else values)]
    parts = [None if part is None else pa.py_buffer(part) for part in (valid, *buffers)]
    return pa.Array.from_buffers(kind, len(values), parts, null_count=nulls)


def _make_array_column(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    width = values.dtype.itemsize
    parts = [np.arange(0, width * len(values) + 1, width, dtype=np.int32)] if kind == pa.string() else []
    parts.append(np.ascontiguousarray(values))
    return pa.Array.from_buffers(kind, len(values), [None, *map(pa.py_buffer, parts)], null_count=0)


def read_numbers(column: pa.Array) -> NDArray[Any]:
    """The numbers of a column, ``(n_rows,)``; any number stands for what is null. Not to be written to.

    Args:
        column: Of ``int64``, ``uint64`` or ``float64``.
    """
    dtype = np.dtype(_CODES[column.type])
    return np.frombuffer(column.buffers()[1], dtype, len(column), dtype.itemsize * column.offset)


def null_where_nan(values: NDArray[np.float64]) -> Sequence[float | None] | NDArray[np.float64]:
    """A column of numbers as `make_column` takes it, in which what is not a number is null."""
    if not np.isnan(values).any():
        return values
    return [None if isnan(value) else value for value in values.tolist()]


def nan_where_null(column: pa.Array) -> NDArray[np.float64]:
    """The numbers of a ``float64`` column, ``(n_rows,)``; NaN for those that are null."""
    return np.where(read_validity(column), read_numbers(column), np.nan)


def read_validity(column: pa.Array) -> NDArray[np.bool_]:
    """Which values of a column are not null, ``(n_rows,)``."""
    bits = column.buffers()[0]
    if bits is None:
        return np.ones(len(column), np.bool_)
    ends = column.offset, column.offset + len(column)
    return np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")[slice(*ends)].astype(np.bool_)


def make_table(columns: Sequence[Sequence[Any] | NDArray[Any]], schema: pa.Schema) -> pa.Table:
    """The Arrow table of columns of Python values.

    Args:
        columns: The columns, each as `make_column` takes it, in the order of the schema.
        schema: Their names and types.
    """
    pairs = zip(columns, schema.types, strict=True)
    return pa.Table.from_arrays([make_column(column, kind) for column, kind in pairs], schema=schema)
