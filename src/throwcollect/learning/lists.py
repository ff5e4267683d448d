"""Lists of numbers in files: targets to aim at, throws that were measured, and parameters that were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from throwcollect.config.task_config import TaskConfig
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import write_file
from throwcollect.learning.aiming import Aim
from throwcollect.learning.fitting import keep_informative
from throwcollect.learning.model import Model
from throwcollect.plan.point_file import problem_of_row, read_numbers, read_table
from throwcollect.wording import join_names


def read_rows(
    path: Path, names: Sequence[str], key: str, *, aliases: Mapping[str, str] = MappingProxyType({})
) -> list[list[float]]:
    """Read some columns of a CSV or Parquet file; a row has a number for each name.

    Args:
        path: The file.
        names: Names of the columns.
        key: Option or argument that names the file.
        aliases: For some of these names, the column that is read instead if the file has no column of that name.
    """
    table = read_table(path, key)
    header = table.column_names
    columns = [name if name in header else aliases.get(name, name) for name in names]
    if missing := [name for name, column in zip(names, columns, strict=True) if column not in header]:
        other = "".join(f", or {aliases[name]} for {name}" for name in missing if name in aliases)
        raise ConfigError(f"{path}: no column {join_names(missing)}", expected=f"columns {', '.join(names)}{other}")
    if twice := [column for column in columns if header.count(column) > 1]:
        raise ConfigError([Problem("the column is here twice", twice[0], path)])
    numbers = read_numbers(table, columns, path)
    for row, column in np.argwhere(~np.isfinite(numbers)).tolist():
        sentence = f"should be a finite number, got {numbers[row, column]}"
        raise ConfigError([problem_of_row(sentence, columns[column], path, row)])
    rows: list[list[float]] = numbers.tolist()
    return rows


def read_targets(path: Path, names: Sequence[str], task: TaskConfig) -> list[list[float]]:
    """Read targets, also from a list that `write_aims` has written.

    `names` are those of the numbers of a target: columns of the table of throws, and keys that are given. The task
    declares the names that columns of targets have in such lists.
    """
    return read_rows(path, names, "--targets", aliases={each.of: each.name for each in task.target_columns})


def read_throws(path: Path, model: Model) -> list[list[float]]:
    """Read throws of another world, of a list or a dataset: all keys that a model takes, and where each throw ended."""
    names = (*model.parameters, *model.given, *model.targets)
    if not path.is_dir():
        return read_rows(path, names, "THROWS")
    dataset, trained = Dataset.open(path), model.trained_on
    robot, task = dataset.config.robot.name, dataset.config.task
    if (robot, task.name) != (trained.robot, trained.task):
        expected = f"{trained.task} of {trained.robot}, as the model has it"
        raise ConfigError(f"{path}: the task {task.name} of the robot {robot}", expected=expected)
    throws = keep_informative(task, dataset.throws, model.targets)
    if missing := [name for name in names if column_of(name) not in throws.column_names]:
        raise ConfigError(f"{path}: has no {join_names(missing)}", expected="throws with all parameters of the model")
    return [list(row) for row in zip(*(throws[column_of(name)].to_pylist() for name in names), strict=True)]


def write_aims(path: Path, aims: Sequence[Aim], names: Sequence[str], task: TaskConfig) -> None:
    """Write a list that the sampler `list` reads: a CSV file with a row for each aim, of which there is at least one.

    `names` are those of `read_targets`. The list has columns only for targets that the task declares.
    """
    columns = {column.name: names.index(column.of) for column in task.target_columns if column.of in names}
    if task.find_wrong_targets(columns):
        columns = {}
    rows = [{**aim.parameters, **{name: float(aim.target[at]) for name, at in columns.items()}} for aim in aims]
    # `repr` writes enough digits that a reader gets the same number.
    lines = [rows[0], *(map(repr, row.values()) for row in rows)]
    write_file(path, "".join(",".join(line) + "\n" for line in lines).encode())
