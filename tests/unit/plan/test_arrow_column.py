from __future__ import annotations

import io
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from throwcollect.plan.arrow_column import find_range, make_column, make_table, read_validity

_COLUMNS: list[tuple[pa.DataType, list[Any]]] = [
    (pa.int64(), [3, -(2**63), 2**63 - 1, np.int64(7), 0, 1, 2, 3, 4]),
    (pa.int64(), [None, 5, None, 0, 1, 2, 3, 4, None]),
    (pa.uint64(), [0, 2**64 - 1, 1, 2, 3, 4, 5, 6, 7]),
    (pa.float64(), [0.5, -0.0, float("inf"), 3, np.float64(0.1), 1e-320, 2.0, 3.0, 4.0]),
    (pa.float64(), [None] * 9),
    (pa.string(), ["landed", "", "zwölf", "Ω", None, "🤖", "x" * 1000, "b", None]),
    (pa.string(), list("abcdefghi")),
]


@pytest.mark.parametrize(("kind", "values"), _COLUMNS)
@pytest.mark.parametrize("rows", [0, 1, 8, 9])
def test_a_made_column_equals_that_of_arrow(kind: pa.DataType, values: list[Any], rows: int) -> None:
    column = make_column(values[:rows], kind)
    column.validate(full=True)
    expected = pa.array(values[:rows], kind)
    assert column.equals(expected)
    assert column.null_count == expected.null_count


def test_a_made_table_is_written_as_that_of_arrow() -> None:
    schema = pa.schema([pa.field(f"column {index}", kind) for index, (kind, _) in enumerate(_COLUMNS)])
    arrays = [pa.array(values, kind) for kind, values in _COLUMNS]
    assert _encode(make_table([values for _, values in _COLUMNS], schema)) == _encode(pa.table(arrays, schema))


@pytest.mark.parametrize(("kind", "value"), [(pa.int64(), 1.5), (pa.float64(), "1"), (pa.int64(), "1")])
def test_values_of_a_wrong_type_are_refused(kind: pa.DataType, value: object) -> None:
    with pytest.raises(TypeError):
        make_column([value], kind)


@pytest.mark.parametrize(("kind", "value"), [(pa.int64(), 2**63), (pa.uint64(), -1)])
def test_numbers_that_do_not_fit_are_refused(kind: pa.DataType, value: int) -> None:
    with pytest.raises(OverflowError):
        make_column([value], kind)


def _encode(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    return buffer.getvalue()


@pytest.mark.parametrize(("kind", "values"), _COLUMNS)
@pytest.mark.parametrize("cut", [0, 1, 3])
def test_read_validity_returns_which_values_are_not_null(kind: pa.DataType, values: list[Any], cut: int) -> None:
    column = make_column(values, kind).slice(cut)
    assert read_validity(column).tolist() == [value is not None for value in values[cut:]]


@pytest.mark.parametrize(("kind", "values"), [each for each in _COLUMNS if each[0] != pa.string()])
@pytest.mark.parametrize("cut", [0, 1, 3, 9])
def test_find_range_equals_min_max_of_arrow(kind: pa.DataType, values: list[Any], cut: int) -> None:
    column = pa.chunked_array([make_column(values, kind).slice(cut)])
    expected = tuple(pc.min_max(column).as_py().values())
    assert find_range(column) == (None if expected == (None, None) else expected)


def test_find_range_covers_all_chunks_and_ignores_nan() -> None:
    column = pa.chunked_array([make_column(values, pa.float64()) for values in ([2.0, None], [], [float("nan"), -1.0])])
    assert find_range(column) == tuple(pc.min_max(column).as_py().values()) == (-1.0, 2.0)
    assert find_range(pa.chunked_array([], pa.int64())) is None
