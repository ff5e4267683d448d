"""Points from a CSV or Parquet file: one row a trial, dotted keys as columns."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError, Problem
from throwcollect.sweep.parquet_file import encode_table
from throwcollect.sweep.points import Points

_MOST_PROBLEMS = 20
_UNNAMED_INDEX = re.compile(r"__index_level_\d+__")
"""Column in which pandas keeps the numbers of rows of which some were taken out; an index with a name may be a key."""


@dataclass(frozen=True)
class _Rows:
    """The rows that hold numbers throughout, where each of them is in the file, and what is wrong with the others."""

    points: Points
    numbers: NDArray[np.intp]
    problems: list[Problem]


def read_points(path: Path, config: Config) -> Points:
    """Read the points of the sampler `list`.

    Args:
        path: File that ends in ``.csv`` (UTF-8, comma, a header line) or ``.parquet``.
        config: Configuration whose keys the columns are.

    Raises:
        ConfigError: If the file cannot be read, or its columns or values cannot be used; it holds all problems, or
            the first 20.
    """
    readers = {".csv": _read_csv, ".parquet": _read_parquet}
    if path.suffix not in readers:
        raise ConfigError([Problem(f"should end in .csv or .parquet, got '{path.name}'", "sweep.file")])
    if not path.is_file():
        problem = f"should be a file, got the directory {path}" if path.is_dir() else f"there is no file {path}"
        raise ConfigError([Problem(problem, "sweep.file")])
    rows = readers[path.suffix](path, config)
    problems = [*rows.problems, *_value_problems(rows, path, config)]
    if problems:
        raise ConfigError(sorted(problems, key=lambda problem: problem.line or 0)[:_MOST_PROBLEMS])
    if not len(rows.numbers):
        raise ConfigError([Problem("the file has no rows", "sweep.file", path)])
    return rows.points


def encode_points(points: Points) -> bytes:
    """Parquet bytes that `read_points` reads; equal points give equal bytes."""
    import pyarrow as pa

    return encode_table(pa.table({key: points.values[:, column] for column, key in enumerate(points.keys)}))


def _read_csv(path: Path, config: Config) -> _Rows:
    problems: list[Problem] = []
    rows: list[list[float]] = []
    lines: list[int] = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            keys = tuple(name.strip() for name in next(reader, []))
            _check_keys(keys, path, config, line=1)
            for cells in reader:
                if not cells:
                    continue
                row, wrong = _row(keys, cells, path, reader.line_num)
                problems += wrong
                if not wrong:
                    rows.append(row)
                    lines.append(reader.line_num)
                if len(problems) >= _MOST_PROBLEMS:
                    break
    except UnicodeDecodeError as error:
        raise ConfigError([Problem("should be UTF-8 text", "sweep.file", path)]) from error
    except csv.Error as error:
        raise ConfigError([Problem(f"not valid CSV: {error}", "sweep.file", path)]) from error
    except OSError as error:
        raise ConfigError([Problem(f"cannot be read: {error.strerror}", "sweep.file", path)]) from error
    return _Rows(Points(keys, np.array(rows).reshape(len(rows), len(keys))), np.array(lines), problems)


def _row(keys: tuple[str, ...], cells: list[str], path: Path, line: int) -> tuple[list[float], list[Problem]]:
    if len(cells) != len(keys):
        return [], [Problem(f"should have {len(keys)} values, got {len(cells)}", "", path, line)]
    row, problems = [], []
    for key, cell in zip(keys, cells, strict=True):
        number = _number(cell)
        row.append(number)
        if not math.isfinite(number):
            problems.append(Problem(f"should be a number, got {cell.strip()!r}", key, path, line))
    return row, problems


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _read_parquet(path: Path, config: Config) -> _Rows:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table: Any = pq.ParquetFile(path).read()
    except (pa.ArrowException, OSError) as error:
        raise ConfigError([Problem(f"cannot be read as Parquet: {error}", "sweep.file", path)]) from error
    table = table.drop_columns([name for name in table.column_names if _UNNAMED_INDEX.fullmatch(name)])
    _check_keys(tuple(table.column_names), path, config, line=None)
    problems: list[Problem] = []
    columns: dict[str, Any] = {}
    good = np.ones(len(table), dtype=bool)
    for field in table.schema:
        column = table[field.name]
        if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
            problems.append(Problem(f"should be a column of numbers, got {field.type}", field.name, path))
            continue
        if nulls := column.null_count:
            problems.append(Problem(f"should have a number in each row, got {nulls} nulls", field.name, path))
        good &= column.is_valid().to_numpy()
        columns[field.name] = column.to_numpy()
    values = np.array([column[good] for column in columns.values()], dtype=np.float64)
    points = Points(tuple(columns), values.reshape(len(columns), np.count_nonzero(good)).T)
    return _Rows(points, np.flatnonzero(good) + 1, problems)


def _check_keys(keys: tuple[str, ...], path: Path, config: Config, *, line: int | None) -> None:
    problems = []
    for index, key in enumerate(keys):
        if key in keys[:index]:
            problems.append(Problem("the column is here twice", key, path, line))
        elif reason := reason_not_sweepable(config, key):
            problems.append(Problem(reason, key or f"column {index + 1}", path, line))
    if not keys:
        problems.append(Problem("the file is empty", "sweep.file", path))
    if problems:
        raise ConfigError(problems, expected="dotted configuration keys as columns")


def _value_problems(rows: _Rows, path: Path, config: Config) -> Iterator[Problem]:
    if not len(rows.numbers):
        return
    for key, column in zip(rows.points.keys, rows.points.values.T, strict=True):
        # What a key allows is an interval, so when both ends fit, all do.
        if not _refusals(config, key, np.array([column.min(), column.max()])):
            continue
        for row, sentence in _refusals(config, key, column):
            number = int(rows.numbers[row])
            if path.suffix == ".csv":
                yield Problem(sentence, key, path, number)
            else:
                yield Problem(f"row {number}: {sentence}", key, path)


def _refusals(config: Config, key: str, column: NDArray[np.float64]) -> list[tuple[int, str]]:
    refusals: list[tuple[int, str]] = []
    for row, value in enumerate(column.tolist()):
        try:
            with_values(config, {key: value})
        except ConfigError as error:
            refusals.append((row, error.problems[0].message))
        if len(refusals) == _MOST_PROBLEMS:
            break
    return refusals
