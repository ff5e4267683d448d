"""Makes and reads Arrow columns without the packages that Arrow would import for it, which take each process some time.

`pyarrow.array` imports pandas wherever that is installed, which takes 0.3 s, and nothing here uses pandas. Most methods
of columns import `pyarrow.compute`, which takes 0.05 s.
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
    """Make the column that ``pyarrow.array(values, kind)`` makes.

    Args:
        values: Numbers or texts; None for null. If it is an array, its elements must be exactly of that kind, without
            nulls; its texts are bytes of one length.
        kind: ``int64``, ``uint64``, ``float64`` or ``string``.
    """
    if isinstance(values, np.ndarray):
        return _make_array_column(values, kind)
    # Arrow's columnar format: a bitmap of the values that are not null, then offsets and text, or numbers.
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
    """View the numbers of a column of ``int64``, ``uint64`` or ``float64``, ``(n_rows,)``; read-only.

    Where the column is null, the number is arbitrary.
    """
    dtype = np.dtype(_CODES[column.type])
    # A column may be a part of a longer one, whose buffers it shares.
    return np.frombuffer(column.buffers()[1], dtype, len(column), dtype.itemsize * column.offset)


def null_where_nan(values: NDArray[np.float64]) -> Sequence[float | None] | NDArray[np.float64]:
    """Replace NaN by None, so that `make_column` makes it null."""
    if not np.isnan(values).any():
        return values
    return [None if isnan(value) else value for value in values.tolist()]


def nan_where_null(column: pa.Array) -> NDArray[np.float64]:
    """Read the numbers of a ``float64`` column, ``(n_rows,)``; NaN for null."""
    return np.where(read_validity(column), read_numbers(column), np.nan)


def read_validity(column: pa.Array) -> NDArray[np.bool_]:
    """Find the rows of a column that are not null, ``(n_rows,)``."""
    bits = column.buffers()[0]
    if bits is None:
        return np.ones(len(column), np.bool_)
    ends = column.offset, column.offset + len(column)
    return np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little")[slice(*ends)].astype(np.bool_)


def find_range(column: pa.ChunkedArray) -> tuple[float, float] | None:
    """Find the least and the largest number of a column, as ``pyarrow.compute.min_max`` does; None if all are null."""
    if column.null_count == len(column):
        return None
    whole = column.combine_chunks()
    numbers = read_numbers(whole)[read_validity(whole)]
    # Like Arrow, these functions leave out NaN, which may stand in tables that others have written.
    return np.fmin.reduce(numbers).item(), np.fmax.reduce(numbers).item()


def find_trial(trials: pa.ChunkedArray, trial: int) -> int:
    """Find the row of a trial in a column of their numbers; -1 if it has none."""
    # Where there are all trials, it is the row of that number. A search for each of a million would take longer than
    # reading their episodes.
    if 0 <= trial < len(trials) and trials[trial].as_py() == trial:
        return trial
    return int(trials.index(trial).as_py())


def make_table(columns: Sequence[Sequence[Any] | NDArray[Any]], schema: pa.Schema) -> pa.Table:
    """Make the Arrow table of columns of Python values, in the order of the schema; see `make_column`."""
    pairs = zip(columns, schema.types, strict=True)
    return pa.Table.from_arrays([make_column(column, kind) for column, kind in pairs], schema=schema)
