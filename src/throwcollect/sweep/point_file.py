"""Reads points from a CSV or Parquet file: one row per trial, dotted keys as columns, and columns of targets."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.task_config import LARGEST_TARGET, is_target
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import suggest_path
from throwcollect.sweep.chosen_motions import add_motions
from throwcollect.sweep.csv_file import MOST_PROBLEMS, read_csv
from throwcollect.sweep.parquet_file import encode_table
from throwcollect.sweep.points import Points

_UNNAMED_INDEX = re.compile(r"__index_level_\d+__")
"""Columns in which pandas keeps row numbers after rows were removed; an index that has a name may be a key."""

_Read = tuple[tuple[str, ...], NDArray[np.float64], Sequence[int]]
"""Columns, numbers with NaN where there is none, and the line or the number of each row."""


def read_points(path: Path, config: Config, *, key: str = "sweep.file") -> Points:
    """Read the points of the sampler `list`.

    Args:
        path: File that ends in ``.csv`` (UTF-8, comma, a header line) or ``.parquet``.
        config: Configuration with the keys that the columns name; its task declares the columns of targets.
        key: Key or option that names the file.
    """
    readers = {".csv": _read_csv, ".parquet": _read_parquet}
    if path.suffix not in readers:
        raise ConfigError([Problem(f"should end in .csv or .parquet, got '{path.name}'", key)])
    try:
        if path.is_dir():
            raise ConfigError([Problem(f"should be a file, got the directory {path}", key)])
        if not path.is_file():
            raise ConfigError([Problem(f"there is no file {path}{suggest_path(path)}", key)])
    except OSError as error:
        raise ConfigError([Problem(f"cannot be read: {error.strerror}", key, path)]) from error
    names, values, rows = readers[path.suffix](path, config)
    if not len(rows):
        raise ConfigError([Problem("the file has no rows", path=path)])
    points = _make_points(names, values, config)
    problems = [*_find_value_problems(points, rows, path, config), *_find_target_problems(points, rows, path, config)]
    if problems:
        raise ConfigError(sorted(problems, key=lambda problem: problem.line or 0)[:MOST_PROBLEMS])
    return add_motions(points, config)


def encode_points(points: Points) -> bytes:
    """Encode points as Parquet for `read_points`; equal points give equal bytes."""
    import pyarrow as pa

    from throwcollect.sweep.arrow_column import make_column, null_where_nan

    columns = [make_column(null_where_nan(each), pa.float64()) for each in points.table.T]
    return encode_table(pa.table(columns, names=list(points.names)))


def _make_points(names: tuple[str, ...], values: NDArray[np.float64], config: Config) -> Points:
    """Put targets behind the keys, in the order of the task."""
    keys = [name for name in names if not is_target(name)]
    ordered = (*keys, *(column.name for column in config.task.target_columns if column.name in names))
    return Points(ordered, values[:, [names.index(name) for name in ordered]])


def _read_csv(path: Path, config: Config) -> _Read:
    check = partial(_check_columns, path=path, config=config)
    return read_csv(path, check, may_be_empty=is_target)


def _read_parquet(path: Path, config: Config) -> _Read:
    """Read the columns, their numbers with NaN for null, and the numbers of the rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table: Any = pq.ParquetFile(path).read()
    except (pa.ArrowException, OSError) as error:
        raise ConfigError([Problem(f"cannot be read as Parquet: {error}", path=path)]) from error
    table = table.drop_columns([name for name in table.column_names if _UNNAMED_INDEX.fullmatch(name)])
    _check_columns(tuple(table.column_names), None, path=path, config=config)
    if wrong := [
        each for each in table.schema if not (pa.types.is_floating(each.type) or pa.types.is_integer(each.type))
    ]:
        raise ConfigError(
            [Problem(f"should be a column of numbers, got {each.type}", each.name, path) for each in wrong]
        )
    values = np.column_stack([column.to_numpy().astype(np.float64) for column in table.columns])
    return tuple(table.column_names), values, range(1, len(table) + 1)


def _check_columns(names: tuple[str, ...], line: int | None, *, path: Path, config: Config) -> tuple[str, ...]:
    problems = []
    targets = [name for name in names if is_target(name)]
    for index, name in enumerate(names):
        if name in names[:index]:
            problems.append(Problem("the column is here twice", name, path, line))
        elif not is_target(name) and (reason := reason_not_sweepable(config, name)):
            problems.append(Problem(reason, name or f"column {index + 1}", path, line))
    problems += [Problem(reason, name, path, line) for name, reason in config.task.find_wrong_targets(targets).items()]
    # Only a policy gets the target, so without one all trials would be the same.
    if len(targets) == len(names) and (not names or config.task.policy is None):
        sentence = "has no column of a key, only targets" if names else "the file is empty"
        problems.append(Problem(sentence, path=path))
    if problems:
        also = ", and targets as the task names them" if targets else ""
        raise ConfigError(problems, expected=f"dotted configuration keys as columns{also}")
    return names


def _find_target_problems(points: Points, rows: Sequence[int], path: Path, config: Config) -> Iterator[Problem]:
    """Find rows with incomplete targets, and with targets that no robot reaches."""
    far = np.argwhere(np.abs(points.targets) > LARGEST_TARGET)
    for row, column in far[:MOST_PROBLEMS].tolist():
        sentence = f"should be a number from {-LARGEST_TARGET:g} to {LARGEST_TARGET:g}"
        yield _of_row(f"{sentence}, got {points.targets[row, column]}", points.target_names[column], path, rows[row])
    there = ~np.isnan(points.targets)
    # Few combinations of targets occur, so each combination is checked once, however many rows have it.
    for pattern in np.unique(there, axis=0):
        names = [name for name, has in zip(points.target_names, pattern.tolist(), strict=True) if has]
        wrong = config.task.find_wrong_targets(names)
        for row in np.flatnonzero((there == pattern).all(axis=1))[:MOST_PROBLEMS] if wrong else ():
            for name, sentence in wrong.items():
                yield _of_row(sentence, name, path, rows[row])


def _of_row(sentence: str, key: str, path: Path, number: int) -> Problem:
    """Make a problem of a row, which CSV counts in lines and Parquet in rows."""
    if path.suffix == ".csv":
        return Problem(sentence, key, path, number)
    return Problem(f"row {number}: {sentence}", key, path)


def _find_value_problems(points: Points, rows: Sequence[int], path: Path, config: Config) -> Iterator[Problem]:
    for key, column in zip(points.keys, points.values.T, strict=True):
        # The allowed values of a key are an interval, so if the least and the largest value are allowed, all are.
        if not _find_refusals(config, key, np.array([column.min(), column.max()])):
            continue
        for row, sentence in _find_refusals(config, key, column):
            yield _of_row(sentence, key, path, rows[row])


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
