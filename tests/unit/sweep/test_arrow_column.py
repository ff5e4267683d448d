from __future__ import annotations

import numpy as np
import pyarrow as pa

from throwcollect.sweep.arrow_column import count_values, find_range, make_table, nan_where_null, null_where_nan


def test_a_column_of_numbers_keeps_them_and_is_null_where_they_are_nan() -> None:
    values = np.array([0.5, np.nan, -0.0, np.inf])
    column = null_where_nan(values)
    assert column.to_pylist() == [0.5, None, 0.0, np.inf]
    assert nan_where_null(column).tobytes() == values.tobytes()


def test_a_table_of_arrays_and_lists_has_the_types_of_its_schema() -> None:
    schema = pa.schema([("name", pa.string()), ("count", pa.int64()), ("seed", pa.uint64())])
    table = make_table([np.array([b"ab", b"cd"]), [None, 3], np.array([0, 2**64 - 1], np.uint64)], schema)
    assert table.to_pylist() == [
        {"name": "ab", "count": None, "seed": 0},
        {"name": "cd", "count": 3, "seed": 2**64 - 1},
    ]


def test_find_range_covers_all_chunks_and_ignores_nan() -> None:
    column = pa.chunked_array([pa.array(values, pa.float64()) for values in ([2.0, None], [], [float("nan"), -1.0])])
    assert find_range(column) == (-1.0, 2.0)
    assert find_range(pa.chunked_array([], pa.int64())) is None


def test_values_are_counted_over_all_chunks_of_a_column() -> None:
    column = pa.chunked_array([pa.array(values, pa.string()) for values in (["a", None, "b"], [], ["a", "a"])])
    assert count_values(column) == {"a": 3, "b": 1, None: 1}
