"""Aimed throws as a list that the sampler `list` reads: parameters, and the targets that they are meant for."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from throwcollect.config.task import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.learning.model import Aim


def write_aims(path: Path, aims: Sequence[Aim], names: Sequence[str], task: TaskConfig) -> None:
    """Write a CSV file with a row for each aim.

    Args:
        path: The file.
        aims: At least one.
        names: What each number of their targets is: a column of the table of throws, or a key that is given.
        task: The task, which declares columns of targets; targets of other things are left out.

    Raises:
        ConfigError: If it cannot be written.
    """
    columns = {column.name: names.index(column.of) for column in task.target_columns if column.of in names}
    if task.find_wrong_targets(columns):
        columns = {}
    rows = [{**each.parameters, **{name: float(each.target[at]) for name, at in columns.items()}} for each in aims]
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(rows[0])
            writer.writerows([map(repr, row.values()) for row in rows])
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
