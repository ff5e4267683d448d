"""Lists in CSV files: targets to aim at, throws that were measured, and parameters that were found."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.target_columns import LARGEST_TARGET
from throwcollect.config.task_config import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.learning.aiming import Aim
from throwcollect.sweep.point_file import explain_wrong_count, explain_wrong_separator, read_number
from throwcollect.wording import join_names


@dataclass(frozen=True)
class Row:
    """Numbers that belong together.

    Attributes:
        place: Where they were read, such as ``targets.csv:3``.
        numbers: The numbers by name.
    """

    place: str
    numbers: dict[str, float]


def read_table(path: Path, names: Sequence[str], *, aliases: dict[str, str] | None = None) -> list[Row]:
    """Read some columns of a CSV file with a header line.

    Args:
        path: The file.
        names: Names of the columns.
        aliases: For some of these names, the column that is read instead if the file has no column of that name.

    Raises:
        ConfigError: If it cannot be read, a column is missing or appears twice, a row has more or fewer values than the
            header has names, or a cell is no finite number.
    """
    try:
        # Spreadsheets begin a CSV file with a byte order mark, which `utf-8-sig` removes from the first column's name.
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            # Lines without any cell are ignored.
            header = [name.strip() for name in next(filter(None, reader), [])]
            columns = _find_columns(header, names, aliases or {}, place=f"{path}:{reader.line_num or 1}")
            rows = [_read_row(cells, header, columns, f"{path}:{reader.line_num}") for cells in reader if cells]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from error
    if not rows:
        raise ConfigError(f"{path}: has no rows", expected=f"columns {', '.join(names)}")
    return rows


def _find_columns(header: list[str], names: Sequence[str], aliases: dict[str, str], place: str) -> dict[str, str]:
    """Find the column that is read for each name.

    Raises:
        ConfigError: If there is none, or there are two.
    """
    columns = {name: aliases.get(name, name) if name not in header else name for name in names}
    if missing := [name for name in names if columns[name] not in header]:
        if problem := explain_wrong_separator(header, {*names, *aliases.values()}.__contains__):
            raise ConfigError(f"{place}: {problem}", expected=f"columns {', '.join(names)}")
        other = "".join(f", or {aliases[name]} for {name}" for name in missing if name in aliases)
        raise ConfigError(f"{place}: no column {join_names(missing)}", expected=f"columns {', '.join(names)}{other}")
    if twice := [column for column in columns.values() if header.count(column) > 1]:
        raise ConfigError(f"{place}: {twice[0]}: the column is here twice", expected="each column once")
    return columns


def _read_row(cells: list[str], header: list[str], columns: dict[str, str], place: str) -> Row:
    """Read the numbers of a row by name.

    Raises:
        ConfigError: If it has more or fewer values than the header has names, or a cell is no finite number.
    """
    if problem := explain_wrong_count(cells, len(header)):
        raise ConfigError(f"{place}: {problem}", expected=f"a value for each of {', '.join(header)}")
    row = dict(zip(header, cells, strict=True))
    numbers = {name: read_number(row[column]) for name, column in columns.items()}
    if wrong := [columns[name] for name, number in numbers.items() if not math.isfinite(number)]:
        raise ConfigError(f"{place}: {wrong[0]}: {row[wrong[0]]!r}", expected="a finite number")
    return Row(place, numbers)


def read_targets(path: Path, names: Sequence[str], task: TaskConfig) -> list[list[float]]:
    """Read targets from a CSV file, also from a list that `write_aims` has written.

    Args:
        path: The file.
        names: Names of the numbers of a target: columns of the table of throws, and keys that are given.
        task: Declares the names that columns of targets have in such lists.

    Raises:
        ConfigError: As `read_table`, or if a number is too large for a target.
    """
    aliases = {column.of: column.name for column in task.target_columns if column.of in names}
    rows = read_table(path, names, aliases=aliases)
    refuse_large_targets(rows, names)
    return [[row.numbers[name] for name in names] for row in rows]


def refuse_large_targets(rows: Sequence[Row], names: Sequence[str]) -> None:
    """Refuse rows with numbers that are so large that their powers are not finite.

    Raises:
        ConfigError: If a number of one of these names is too large for a target.
    """
    for row in rows:
        for name in names:
            if abs(row.numbers[name]) > LARGEST_TARGET:
                raise ConfigError(
                    f"{row.place}: {name}: {row.numbers[name]:g}", expected=f"a number of at most {LARGEST_TARGET:g}"
                )


def write_aims(path: Path, aims: Sequence[Aim], names: Sequence[str], task: TaskConfig) -> None:
    """Write a list that the sampler `list` reads: a CSV file with a row for each aim, of which there is at least one.

    `names` are those of the numbers of a target: columns of the table of throws, and keys that are given. The list has
    columns only for targets that the task declares.

    Raises:
        ConfigError: If the name of the file does not end in ``.csv``.
        DatasetError: If it cannot be written.
    """
    if path.suffix != ".csv":
        raise ConfigError(f"{path}: lists are written only as CSV", expected="a name with .csv")
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
