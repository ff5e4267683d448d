"""Lists in CSV files: targets to aim at, throws that were measured, and parameters that were found."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from throwcollect.config.task_config import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.learning.aiming import Aim
from throwcollect.sweep.csv_file import read_csv
from throwcollect.wording import join_names


def read_table(path: Path, names: Sequence[str], *, aliases: dict[str, str] | None = None) -> list[list[float]]:
    """Read some columns of a CSV file with a header line; a row has a number for each name.

    Args:
        path: The file.
        names: Names of the columns.
        aliases: For some of these names, the column that is read instead if the file has no column of that name.
    """

    def choose(header: tuple[str, ...], line: int) -> list[str]:
        return _find_columns(header, names, aliases or {}, place=f"{path}:{line or 1}")

    _, values, lines = read_csv(path, choose)
    if not lines:
        raise ConfigError(f"{path}: has no rows", expected=f"columns {', '.join(names)}")
    rows: list[list[float]] = values.tolist()
    return rows


def _find_columns(header: Sequence[str], names: Sequence[str], aliases: dict[str, str], place: str) -> list[str]:
    """Find the column that is read for each name."""
    columns = [name if name in header else aliases.get(name, name) for name in names]
    if missing := [name for name, column in zip(names, columns, strict=True) if column not in header]:
        other = "".join(f", or {aliases[name]} for {name}" for name in missing if name in aliases)
        raise ConfigError(f"{place}: no column {join_names(missing)}", expected=f"columns {', '.join(names)}{other}")
    if twice := [column for column in columns if header.count(column) > 1]:
        raise ConfigError(f"{place}: {twice[0]}: the column is here twice", expected="each column once")
    return columns


def read_targets(path: Path, names: Sequence[str], task: TaskConfig) -> list[list[float]]:
    """Read targets from a CSV file, also from a list that `write_aims` has written.

    Args:
        path: The file.
        names: Names of the numbers of a target: columns of the table of throws, and keys that are given.
        task: Declares the names that columns of targets have in such lists.
    """
    aliases = {column.of: column.name for column in task.target_columns if column.of in names}
    return read_table(path, names, aliases=aliases)


def write_aims(path: Path, aims: Sequence[Aim], names: Sequence[str], task: TaskConfig) -> None:
    """Write a list that the sampler `list` reads: a CSV file with a row for each aim, of which there is at least one.

    `names` are those of the numbers of a target: columns of the table of throws, and keys that are given. The list has
    columns only for targets that the task declares.
    """
    columns = {column.name: names.index(column.of) for column in task.target_columns if column.of in names}
    if task.find_wrong_targets(columns):
        columns = {}
    rows = [{**aim.parameters, **{name: float(aim.target[at]) for name, at in columns.items()}} for aim in aims]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0])
    # `repr` writes enough digits that a reader gets the same number.
    writer.writerows([map(repr, row.values()) for row in rows])
    write_file(path, text.getvalue().encode())
