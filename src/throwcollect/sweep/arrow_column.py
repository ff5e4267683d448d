"""Makes and reads Arrow columns of numbers, strings and nulls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def nan_where_null(column: pa.Array) -> NDArray[np.float64]:
    """Read the numbers of a ``float64`` column, ``(n_rows,)``; NaN for null."""
    numbers: NDArray[np.float64] = column.to_numpy(zero_copy_only=False)
    return numbers


def null_where_nan(values: NDArray[np.float64]) -> pa.Array:
    """Make a ``float64`` column, which is null where a number is NaN."""
    return pa.array(values, mask=np.isnan(values))


def find_range(column: pa.ChunkedArray) -> tuple[float, float] | None:
    """Find the least and the largest number of a column; None if all are null."""
    import pyarrow.compute as pc

    found = pc.min_max(column).as_py()
    return None if found["min"] is None else (found["min"], found["max"])


def find_trial(trials: pa.ChunkedArray, trial: int) -> int:
    """Find the row of a trial in a column of their numbers; -1 if it has none."""
    # Where there are all trials, it is the row of that number. A search for each of a million would take longer than
    # reading their episodes.
    if 0 <= trial < len(trials) and trials[trial].as_py() == trial:
        return trial
    return int(trials.index(trial).as_py())


def count_values(column: pa.ChunkedArray) -> Mapping[Any, int]:
    """Count how often each value of a column occurs; null is None."""
    return {each["values"]: each["counts"] for each in column.value_counts().to_pylist()}


def make_table(columns: Sequence[Any], schema: pa.Schema) -> pa.Table:
    """Make the Arrow table of columns of values, in the order of the schema; arrays of bytes are strings."""
    arrays = [
        column.astype(str) if isinstance(column, np.ndarray) and column.dtype.kind == "S" else column
        for column in columns
    ]
    pairs = zip(arrays, schema.types, strict=True)
    return pa.Table.from_arrays(
        [each if isinstance(each, pa.Array) else pa.array(each, kind) for each, kind in pairs], schema=schema
    )
