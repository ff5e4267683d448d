"""Lists in CSV files: columns are found by name, ambiguous rows are refused, files are written as a whole."""

from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.learning.lists import read_table

TARGETS = ("landing_x_m", "landing_y_m")
HEADER = "landing_x_m,landing_y_m"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


def test_a_list_may_have_its_columns_in_any_order_among_others(table: Path) -> None:
    table.write_text("note, landing_y_m, landing_x_m, note\na, -0.29, 1.63, b\n\n, 2, 1,\n")
    assert read_table(table, TARGETS) == [[1.63, -0.29], [1.0, 2.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEADER}\n1.63,-0.29,0.3\n", ":2: should have 2 values, got 3"),
        (f"{HEADER},note\n1.63,-0.29\n", ":2: should have 3 values, got 2"),
        ("x,y\n1,0\n", ":1: no column landing_x_m and landing_y_m"),
        (f"{HEADER},landing_x_m\n1,0,2\n", ":1: landing_x_m: the column is here twice"),
        (f"\n{HEADER}\n1,\n", ":3: landing_y_m: should be a number, got ''"),
        (f"{HEADER}\n1,inf\n", ":2: landing_y_m: should be a number, got 'inf'"),
    ],
)
def test_an_ambiguous_row_of_a_list_is_refused_with_its_line(table: Path, text: str, message: str) -> None:
    table.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_table(table, TARGETS)
    assert caught.value.message == f"{table}{message}"
