"""Lists in CSV files: targets to aim at, throws that were measured, and parameters that were found."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from throwcollect.config.task import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.learning.model import Aim
from throwcollect.sweep.point_file import read_number
from throwcollect.wording import join_names


def read_table(path: Path, names: Sequence[str], *, aliases: dict[str, str] | None = None) -> list[dict[str, float]]:
    """Read some columns of a CSV file with a header line.

    Args:
        path: The file.
        names: Names of the columns.
        aliases: For some of these names, the column that is read instead where the file has none of that name.

    Raises:
        ConfigError: If it cannot be read, a column is missing, or a cell is no finite number.
    """
    try:
        # Spreadsheets begin a CSV file with a byte order mark, which would belong to the name of the first column.
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            header = reader.fieldnames or []
            instead = {name: alias for name, alias in (aliases or {}).items() if name not in header}
            columns = {name: instead.get(name, name) for name in names}
            if missing := [name for name in names if columns[name] not in header]:
                other = "".join(f", or {aliases[name]} for {name}" for name in missing if aliases and name in aliases)
                raise ConfigError(
                    f"{path}:1: no column {join_names(missing)}", expected=f"columns {', '.join(names)}{other}"
                )
            rows = []
            for row in reader:
                numbers = {name: read_number(row[column]) for name, column in columns.items()}
                if wrong := [column for name, column in columns.items() if not math.isfinite(numbers[name])]:
                    raise ConfigError(
                        f"{path}:{reader.line_num}: {wrong[0]}: {row[wrong[0]] or ''!r}", expected="a finite number"
                    )
                rows.append(numbers)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from error
    if not rows:
        raise ConfigError(f"{path}: has no rows", expected=f"columns {', '.join(names)}")
    return rows


def read_targets(path: Path, names: Sequence[str], task: TaskConfig) -> list[list[float]]:
    """Read targets from a CSV file, also from a list that `write_aims` has written.

    Args:
        path: The file.
        names: What the numbers of a target are: columns of the table of throws, and keys that are given.
        task: Declares the columns of targets that stand in such lists.

    Raises:
        ConfigError: If it cannot be read, a column is missing, or a cell is no finite number.
    """
    aliases = {column.of: column.name for column in task.target_columns if column.of in names}
    return [[row[name] for name in names] for row in read_table(path, names, aliases=aliases)]


def write_aims(path: Path, aims: Sequence[Aim], names: Sequence[str], task: TaskConfig) -> None:
    """Write a list that the sampler `list` reads: a CSV file with a row for each aim, of which there is at least one.

    Each of the names says what a number of their targets is: a column of the table of throws, or a key that is given.
    The list has columns for those targets alone that the task declares.

    Raises:
        ConfigError: If the file cannot be written.
    """
    columns = {column.name: names.index(column.of) for column in task.target_columns if column.of in names}
    if task.find_wrong_targets(columns):
        columns = {}
    rows = [{**aim.parameters, **{name: float(aim.target[at]) for name, at in columns.items()}} for aim in aims]
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(rows[0])
            # repr writes as many digits as it takes to read the same number again.
            writer.writerows([map(repr, row.values()) for row in rows])
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
