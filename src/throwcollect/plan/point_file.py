"""Reads points from a CSV or Parquet file: one row per trial, dotted keys as columns, and columns of targets."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.task_config import LARGEST_TARGET, is_target
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import suggest_path
from throwcollect.plan.arrow_column import make_table, null_where_nan
from throwcollect.plan.chosen_motions import add_motions
from throwcollect.plan.parquet_file import encode_table
from throwcollect.plan.trials import Points

_UNNAMED_INDEX = re.compile(r"__index_level_\d+__")
"""Columns in which pandas keeps row numbers after rows were removed; an index that has a name may be a key."""
MOST_PROBLEMS = 20


def read_points(path: Path, config: Config, *, key: str = "sweep.file") -> Points:
    """Read the points of the sampler `list`.

    Args:
        path: The file, as `read_table` takes it.
        config: Configuration with the keys that the columns name; its task declares the columns of targets.
        key: Key or option that names the file.
    """
    table = read_table(path, key)
    names = tuple(table.column_names)
    _check_columns(names, path, config)
    values = read_numbers(table, names, path)
    ordered = [name for name in names if not is_target(name)]
    # Targets stand behind the keys, in the order of the task.
    ordered += [column.name for column in config.task.target_columns if column.name in names]
    points = Points(tuple(ordered), values[:, [names.index(name) for name in ordered]])
    if problems := [*_find_value_problems(points, path, config), *_find_target_problems(points, path, config)]:
        raise ConfigError(problems[:MOST_PROBLEMS])
    return add_motions(points, config)


def read_table(path: Path, key: str) -> pa.Table:
    """Read the table in a file that ends in ``.csv`` (UTF-8, comma, a header line) or ``.parquet``; it has rows.

    Messages name the file by its key or option.
    """
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise ConfigError([Problem(f"should end in .csv or .parquet, got '{path.name}'", key)])
    try:
        if not path.exists():
            raise ConfigError([Problem(f"there is no file {path}{suggest_path(path)}", key)])
        if _is_csv(path):
            # In one block, as the types of columns follow from the first block; errors of one thread have the row.
            whole = pa.csv.ReadOptions(block_size=path.stat().st_size + 1, use_threads=False)
            empty = pa.csv.ConvertOptions(null_values=["", " "])
            table = pa.csv.read_csv(path, read_options=whole, convert_options=empty)
            table = table.rename_columns([name.strip() for name in table.column_names])
        else:
            table = pq.ParquetFile(path).read()
            table = table.drop_columns([name for name in table.column_names if _UNNAMED_INDEX.fullmatch(name)])
    except (ValueError, OSError) as error:
        raise ConfigError([Problem(f"cannot be read: {error}", key, path)]) from error
    if not len(table):
        raise ConfigError([Problem("the file has no rows", path=path)])
    return table


def read_numbers(table: pa.Table, names: Sequence[str], path: Path) -> NDArray[np.float64]:
    """Read columns of a table of `read_table`, NaN where a cell is empty, shape ``(n_rows, n_names)``."""
    numbers = []
    for name in names:
        column, kind = table[name], table.schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)):
            if pa.types.is_string(kind):
                # One cell that is no number makes the whole column one of strings.
                for row, cell in enumerate(column.to_pylist()):
                    if cell is not None and not _is_number(cell):
                        raise ConfigError([problem_of_row(f"should be a number, got {cell!r}", name, path, row)])
            raise ConfigError([Problem(f"should be a column of numbers, got {kind}", name, path)])
        # Integers beyond 2^53 are rounded, as other numbers are.
        numbers.append(column.cast(pa.float64(), safe=False).to_numpy())
    return np.column_stack(numbers)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def encode_points(points: Points) -> bytes:
    """Encode points as Parquet for `read_points`; equal points give equal bytes."""
    schema = pa.schema([(name, pa.float64()) for name in points.names])
    return encode_table(make_table([*map(null_where_nan, points.table.T)], schema))


def _check_columns(names: tuple[str, ...], path: Path, config: Config) -> None:
    problems = []
    targets = [name for name in names if is_target(name)]
    for index, name in enumerate(names):
        if name in names[:index]:
            problems.append(Problem("the column is here twice", name, path))
        elif not is_target(name) and (reason := reason_not_sweepable(config, name)):
            problems.append(Problem(reason, name or f"column {index + 1}", path))
    problems += [Problem(reason, name, path) for name, reason in config.task.find_wrong_targets(targets).items()]
    # Only a policy gets the target, so without one all trials would be the same.
    if len(targets) == len(names) and config.task.policy is None:
        problems.append(Problem("has no column of a key, only targets", path=path))
    if problems:
        also = ", and targets as the task names them" if targets else ""
        raise ConfigError(problems, expected=f"dotted configuration keys as columns{also}")


def _find_target_problems(points: Points, path: Path, config: Config) -> Iterator[Problem]:
    """Find rows with incomplete targets, and with targets that no robot reaches."""
    far = np.argwhere(np.abs(points.targets) > LARGEST_TARGET)
    for row, column in far[:MOST_PROBLEMS].tolist():
        sentence = f"should be a number from {-LARGEST_TARGET:g} to {LARGEST_TARGET:g}"
        yield problem_of_row(f"{sentence}, got {points.targets[row, column]}", points.target_names[column], path, row)
    there = ~np.isnan(points.targets)
    # Few combinations of targets occur, so each combination is checked once, however many rows have it.
    for pattern in np.unique(there, axis=0):
        names = [name for name, has in zip(points.target_names, pattern.tolist(), strict=True) if has]
        wrong = config.task.find_wrong_targets(names)
        for row in np.flatnonzero((there == pattern).all(axis=1))[:MOST_PROBLEMS] if wrong else ():
            for name, sentence in wrong.items():
                yield problem_of_row(sentence, name, path, row)


def problem_of_row(sentence: str, key: str, path: Path, row: int) -> Problem:
    """Make a problem of a row, which is counted from 0 here, in CSV files by lines, and in Parquet files from 1."""
    if not _is_csv(path):
        return Problem(f"row {row + 1}: {sentence}", key, path)
    with path.open(encoding="utf-8") as file:
        filled = (number for number, line in enumerate(file, start=1) if line.strip())
        return Problem(sentence, key, path, next(islice(filled, row + 1, None)))


def _is_csv(path: Path) -> bool:
    return path.suffix.lower() == ".csv"


def _find_value_problems(points: Points, path: Path, config: Config) -> Iterator[Problem]:
    for key, column in zip(points.keys, points.values.T, strict=True):
        # The allowed values of a key are an interval, so if the least and the largest value are allowed, all are.
        if not _find_refusals(config, key, np.array([column.min(), column.max()])):
            continue
        for row, sentence in _find_refusals(config, key, column):
            yield problem_of_row(sentence, key, path, row)


def _find_refusals(config: Config, key: str, column: NDArray[np.float64]) -> list[tuple[int, str]]:
    refusals: list[tuple[int, str]] = []
    for row, value in enumerate(column.tolist()):
        try:
            with_values(config, {key: value})
        except ConfigError as error:
            refusals.append((row, error.problems[0].message))
        if len(refusals) == MOST_PROBLEMS:
            break
    return refusals
