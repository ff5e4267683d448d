"""Lists in CSV files: columns are found by name, ambiguous rows are refused, files are written as a whole."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.learning.aiming import Aim
from throwcollect.learning.lists import Row, read_table, read_targets, write_aims

TARGETS = ("landing_x_m", "landing_y_m")
HEADER = "landing_x_m,landing_y_m"


END = np.array([1.4, -0.2])
AIM = Aim(END, {"task.duration_s": 1.1}, END, True, END)


@contextmanager
def small_disk(most_bytes: int) -> Iterator[None]:
    """Within the block, this process cannot write a longer file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


def test_a_list_may_have_its_columns_in_any_order_among_others(table: Path) -> None:
    table.write_text("note, landing_y_m, landing_x_m, note\na, -0.29, 1.63, b\n\n, 2, 1,\n")
    assert read_table(table, TARGETS) == [
        Row(f"{table}:2", dict(zip(TARGETS, (1.63, -0.29), strict=True))),
        Row(f"{table}:4", dict(zip(TARGETS, (1.0, 2.0), strict=True))),
    ]


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


def test_a_list_that_is_missing_is_refused_with_the_name_of_a_similar_one(table: Path) -> None:
    table.write_text(HEADER)
    with pytest.raises(ConfigError, match=r"tables\.csv: no such file; did you mean '\S+/table\.csv'\?$"):
        read_table(table.with_name("tables.csv"), TARGETS)


def test_a_target_that_is_too_large_is_refused_with_its_line(table: Path) -> None:
    table.write_text(f"{HEADER}\n1,0\n1,-2e6\n")
    with pytest.raises(ConfigError, match=f"{table}:3: landing_y_m: -2e\\+06\n  expected: a number of at most 1e\\+06"):
        read_targets(table, TARGETS, Config().task)


@pytest.mark.parametrize("name", ["aims.parquet", "aims.txt", "aims"])
def test_a_list_is_only_written_to_a_name_with_csv(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        write_aims(tmp_path / name, [AIM], TARGETS, Config().task)
    assert caught.value.expected == "a name with .csv"
    assert not (tmp_path / name).exists()


def test_a_failed_write_of_a_list_leaves_the_previous_file(table: Path) -> None:
    table.write_text("earlier")
    with small_disk(10), pytest.raises(DatasetError, match="cannot be written: File too large") as caught:
        write_aims(table, [AIM], TARGETS, Config().task)
    assert caught.value.hint
    assert [path.read_text() for path in table.parent.iterdir()] == ["earlier"]
