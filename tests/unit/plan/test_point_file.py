import re

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.plan.point_file import encode_points, read_points

HEADER = "ball.mass_kg,task.duration_s\n"


@pytest.fixture
def csv(tmp_path):
    def csv(content: str | bytes):
        path = tmp_path / "list.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return csv


@pytest.fixture
def parquet(tmp_path):
    def parquet(columns: dict):
        path = tmp_path / "list.parquet"
        pq.write_table(pa.table(columns), path)
        return path

    return parquet


def problems(path) -> list[str]:
    with pytest.raises(ConfigError, match=r"\S") as caught:
        read_points(path, Config())
    return [str(problem).replace(f"{path.parent}/", "") for problem in caught.value.problems]


def test_rows_of_a_csv_file_are_trials_and_columns_are_keys(csv):
    points = read_points(csv("\ufeffball.mass_kg, task.duration_s\r\n0.1, 1\r\n\r\n2e-1,1.5\r\n"), Config())
    assert points.keys == ("ball.mass_kg", "task.duration_s")
    assert points.values.tolist() == [[0.1, 1.0], [0.2, 1.5]]


def test_rows_of_a_parquet_file_are_trials_and_columns_are_keys(parquet):
    path = parquet({"ball.mass_kg": pa.array([0.1, 0.2]), "task.duration_s": pa.array([1, 2], pa.int16())})
    points = read_points(path, Config())
    assert points.keys == ("ball.mass_kg", "task.duration_s")
    assert points.values.tolist() == [[0.1, 1.0], [0.2, 2.0]]


def test_the_row_numbers_of_pandas_are_not_taken_for_a_key(tmp_path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"ball.mass_kg": [0.1, 0.9, 0.2, 0.3], "task.duration_s": [1.0, 1.0, 1.5, 2.0]})
    path = tmp_path / "list.parquet"
    frame[frame["ball.mass_kg"] < 0.5].set_index("task.duration_s", append=True).to_parquet(path)
    assert "__index_level_0__" in pq.read_schema(path).names
    points = read_points(path, Config())
    assert points.keys == ("ball.mass_kg", "task.duration_s")
    assert points.values.tolist() == [[0.1, 1.0], [0.2, 1.5], [0.3, 2.0]]


@pytest.mark.parametrize(
    ("content", "messages"),
    [
        ("", ["list.csv: sweep.file: cannot be read: Empty CSV file"]),
        (
            "seed,ball.mass_kg,ball.mass_kg\n1,1,1\n",
            ["list.csv: seed: cannot vary from trial to trial", "list.csv: ball.mass_kg: the column is here twice"],
        ),
        (HEADER + "0.1,1\n\n0.1,fast\n", ["list.csv:4: task.duration_s: should be a number, got 'fast'"]),
        (HEADER + "0.1,1\n0.1,\n", ["list.csv:3: task.duration_s: should be a finite number, got nan"]),
    ],
)
def test_problems_of_a_csv_file_name_their_lines(csv, content, messages):
    assert problems(csv(content)) == messages


def test_a_file_that_is_no_table_is_a_problem(tmp_path):
    assert problems(tmp_path / "missing.csv") == ["sweep.file: there is no file missing.csv"]
    assert problems(tmp_path / "list.json") == ["sweep.file: should end in .csv or .parquet, got 'list.json'"]
    assert "File name too long" in problems(tmp_path / f"{300 * 'x'}.csv")[0]
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(b"no Parquet at all")
    (tmp_path / "latin.csv").write_bytes(b"ball.mass_kg\n\xff\n")
    assert problems(tmp_path / "latin.csv") == ["latin.csv: ball.mass_kg: should be a column of numbers, got binary"]
    assert problems(broken)[0].startswith("broken.parquet: sweep.file: cannot be read: ")
    (tmp_path / "points.csv").touch()
    near = "there is no file point.csv; did you mean 'points.csv'?"
    assert problems(tmp_path / "point.csv") == [f"sweep.file: {near}"]
    with pytest.raises(ConfigError, match=f"^--list: {re.escape(near).replace('point', '.*point')}$"):
        read_points(tmp_path / "point.csv", Config(), key="--list")


TARGETED = "task.duration_s,target_y_m,target_x_m\n"


def test_columns_of_targets_are_no_keys_and_may_be_empty_in_a_row(csv):
    points = read_points(csv(TARGETED + "1.0,-0.2,1.4\n1.1,,\n1.2, ,\n"), Config())
    assert points.keys == ("task.duration_s",)
    assert points.values.tolist() == [[1.0], [1.1], [1.2]]
    assert points.target_names == ("target_x_m", "target_y_m")
    assert [points.row(number)[1] for number in range(3)] == [{"target_x_m": 1.4, "target_y_m": -0.2}, {}, {}]


def test_targets_survive_the_way_through_a_parquet_file(csv, tmp_path):
    points = read_points(csv(TARGETED + "1.0,-0.2,1.4\n1.1,,\n"), Config())
    path = tmp_path / "points.parquet"
    path.write_bytes(encode_points(points))
    assert read_points(path, Config()) == points
    assert pq.read_table(path)["target_x_m"].to_pylist() == [1.4, None]
