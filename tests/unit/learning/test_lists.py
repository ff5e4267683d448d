"""Lists of numbers: columns are found by name, whatever the format."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.learning.lists import read_rows

TARGETS = ("landing_x_m", "landing_y_m")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


def test_a_list_may_have_its_columns_in_any_order_among_others(table: Path) -> None:
    table.write_text("\ufeffnote, landing_y_m, landing_x_m, note\na, -0.29, 1.63, b\n\n, 2, 1,\n")
    assert read_rows(table, TARGETS, "--targets") == [[1.63, -0.29], [1.0, 2.0]]
    parquet = table.with_suffix(".parquet")
    pq.write_table(pa.table({"note": ["a"], "landing_y_m": [-0.29], "landing_x_m": [1]}), parquet)
    assert read_rows(parquet, TARGETS, "--targets") == [[1.0, -0.29]]
