"""The table of throws: one row a trial, with its swept values, its result, and the place of its episode."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.config.shape import unit_of_key
from throwcollect.config.task_config import TARGET_PREFIX, is_target
from throwcollect.config.values import column_of
from throwcollect.dataset.directory import SOURCES, THROWS, list_shards
from throwcollect.dataset.misses import Misses
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.members import explain_failure
from throwcollect.sweep.arrow_column import count_values, find_range, make_table, read_numbers, read_validity
from throwcollect.sweep.parquet_file import read_parquet
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.measures import BallState
from throwcollect.tasks.result import LIMIT_VIOLATED, LOST, REFUSED, TRACKING_FAILED, Result
from throwcollect.tasks.result_columns import ball_columns, join_ball
from throwcollect.tasks.task import Task, task_of
from throwcollect.units import ascii_unit, unit_of_name

Row = dict[str, Any]
"""A row of the table, by column; what is null there is None."""

_KINDS = {"number": pa.float64(), "count": pa.int64(), "text": pa.string()}
"""Types of the columns that tasks declare."""
_ROWS_A_PIECE = 500
"""Number of rows that are made at a time: enough that this takes no longer than making all at once."""


@dataclass(frozen=True)
class EpisodePlace:
    """The place of an episode in a dataset: its MCAP file and the offset of its first chunk there [bytes].

    Number of samples and digest say which episode it is.
    """

    shard: str
    chunk_offset: int
    samples: int
    digest: str


def make_field(name: str, kind: pa.DataType, description: str, *, unit: str | None = None) -> pa.Field:
    """Make a column of a table, with its description for people; numbers have a unit, by default that of the name."""
    metadata = {"description": description}
    if kind != pa.string():
        metadata["unit"] = ascii_unit(unit_of_name(name) if unit is None else unit)
    return pa.field(name, kind, metadata=metadata)


def ball_state(row: Row, name: str) -> BallState | None:
    """Read the state of the ball at ``release``, ``apex`` or ``landing`` from a row of the table of throws.

    It is None if the trial came to no such event, or its task knows none.
    """
    values: list[Any] = [row.get(column) for column in ball_columns(name)]
    return None if None in values else join_ball(values)


def _check_task(task: Task[Any], columns: Sequence[str]) -> None:
    """Make sure that a task, which may be of another package, can have its results in a table of these columns."""
    name, outcomes = task.config.task.name, {each.value for each in task.outcomes}
    needed = (task.config.task.success, LIMIT_VIOLATED, TRACKING_FAILED, LOST)
    if missing := [each for each in needed if each not in outcomes]:
        raise ConfigError(f"task.name: outcomes of the task {name} lack {', '.join(missing)}")
    if twice := [column for column, count in Counter(columns).items() if count > 1]:
        raise ConfigError(
            f"task.name: two columns of the table of throws of the task {name} have the same name: {', '.join(twice)}",
            hint="rename the fields of its results; a swept key has underscores in place of dots",
        )
    # Whoever reads the table takes columns of these names for targets that the trials were given.
    if targets := [each.name for each in task.columns.columns if is_target(each.name)]:
        raise ConfigError(
            f"task.name: results of the task {name} have columns that begin with {TARGET_PREFIX}, as only targets of "
            f"trials may: {', '.join(targets)}",
            hint="rename the fields of its results",
        )


class ThrowsTable:
    """The schema of one collection's table; turns results into rows, and rows into results.

    Attributes:
        columns: Columns with their types.

    The parameters are the swept keys, and the targets columns of targets, in their order.

    Raises:
        ConfigError: If the task lacks an outcome that it needs, or a column of its results has the name of another.
        MemberError: If the task comes from another package, and fails to declare its results.
    """

    def __init__(self, parameters: Sequence[str], config: Config, targets: Sequence[str] = ()) -> None:
        self._parameters = tuple(parameters)
        self._misses = Misses(config, targets)
        task = task_of(config)
        self._outcomes = task.outcomes
        with explain_failure("tasks", config.task.name, "declare its results"):
            self._columns = task.columns
        self.columns = pa.schema(
            [
                make_field("trial", pa.int64(), "Number of the trial."),
                *(pa.field(column_of(key), pa.float64()) for key in parameters),
                *(make_field(each.name, pa.float64(), each.description) for each in self._misses.targets),
                make_field("outcome", pa.string(), f"{', '.join(each.value for each in task.outcomes)} or {REFUSED}."),
                make_field("reason", pa.string(), task.reasons),
                *(make_field(each.name, _KINDS[each.kind], each.description) for each in self._columns.columns),
                *(make_field(name, pa.float64(), text) for name, text in self._misses.descriptions.items()),
                make_field("shard", pa.string(), "MCAP file that holds the episode; null when there is none."),
                make_field("chunk_offset", pa.int64(), "Where the episode's chunk begins in that file [bytes]."),
                make_field("samples", pa.int64(), "Number of samples of the episode."),
                make_field("digest", pa.string(), "SHA-256 of the episode: of its header and its message records."),
            ]
        )
        _check_task(task, self.columns.names)

    @cached_property
    def schema(self) -> pa.Schema:
        """The columns with their descriptions; units of swept keys come from the JSON Schema, which takes 40 ms."""
        schema = self.columns
        for place, (key, unit) in enumerate(zip(self._parameters, map(unit_of_key, self._parameters), strict=True), 1):
            text = f"Swept value of {key} [{unit or '-'}]."
            schema = schema.set(place, make_field(column_of(key), pa.float64(), text, unit=unit))
        return schema

    @classmethod
    def of(cls, plan: Plan) -> ThrowsTable:
        """Make the table of a plan's trials."""
        return cls(plan.keys, plan.config, plan.trials.points.target_names)

    def row(self, trial: Trial, result: Result, place: EpisodePlace | None) -> Row:
        """Make the row of a trial that was run; `place` is None if it has no episode."""
        row = self._start_row(trial, result.outcome.value, result.reason)
        row.update(self._columns.write(result))
        row.update(self._misses.measure(trial.target, row))
        if place is not None:
            row.update(vars(place))
        return row

    def make_refused_row(self, trial: Trial) -> Row:
        """Make the row of a trial that the plan refused."""
        return self._start_row(trial, REFUSED, trial.refused)

    def result(self, row: Row) -> Result:
        """Make the result of a trial that was run from its row, as `row` wrote it."""
        result: Result = self._columns.read(self._outcomes(row["outcome"]), row["reason"], row)
        return result

    def _start_row(self, trial: Trial, outcome: str, reason: str | None) -> Row:
        values = {column_of(key): trial.values[key] for key in self._parameters}
        return {"trial": trial.number, **values, **trial.target, "outcome": outcome, "reason": reason}

    def table(self, rows: Iterable[Row]) -> pa.Table:
        """Make an Arrow table of rows, in the given order; a value that a row lacks is null."""
        rows = list(rows)
        return make_table([[row.get(name) for row in rows] for name in self.schema.names], self.schema)


def read_throws_table(path: Path, plan: Plan) -> pa.Table:
    """Read a table of throws with the columns of a plan, whatever trials its rows are of."""
    table = read_parquet(path)
    schema = ThrowsTable.of(plan).columns
    # Metadata are not compared: descriptions of columns may have been worded otherwise when the table was written.
    if not table.schema.equals(schema):
        wrong = sorted(set(table.schema.names) ^ set(schema.names)) or "types of columns"
        raise DatasetError(f"not the table of this plan: differs in {wrong}", path=path)
    return table


def count_outcomes(throws: pa.Table) -> dict[str, int]:
    """Count the trials of each outcome, most frequent first."""
    counts = count_values(throws["outcome"])
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


class RowsByTrial(Mapping[int, Row]):
    """The rows of a table of throws, in order of trials; rows without a trial are left out.

    Only a piece of the table at a time is made into rows, which take ten times its memory: a million rows would take
    3 GB.

    Args:
        table: The table.
        recorded: Whether rows of trials without an episode are left out, too.
    """

    def __init__(self, table: pa.Table, *, recorded: bool = False) -> None:
        self._table = table
        places = np.flatnonzero(read_validity(table["digest" if recorded else "trial"].combine_chunks()))[::-1]
        # Of the rows of one trial in a damaged table, the last one counts.
        self._trials, first = np.unique(read_numbers(table["trial"].combine_chunks())[places], return_index=True)
        self._places = places[first]
        self._start = 0
        self._piece: list[Row] = []

    def __getitem__(self, trial: int) -> Row:
        # Dictionaries of a million trials would take 200 MB.
        index = int(np.searchsorted(self._trials, trial))
        if index == len(self) or self._trials[index] != trial:
            raise KeyError(trial)
        place = int(self._places[index])
        if not self._start <= place < self._start + len(self._piece):
            self._start = place - place % _ROWS_A_PIECE
            self._piece = self._table.slice(self._start, _ROWS_A_PIECE).to_pylist()
        return self._piece[place - self._start]

    def __iter__(self) -> Iterator[int]:
        return map(int, self._trials)

    def __len__(self) -> int:
        return len(self._trials)


def read_throws(directory: Path, plan: Plan) -> pa.Table:
    """Read the table of throws of a dataset: the trials of its plan in order, or some of them if it was derived."""
    path = directory / THROWS
    table = read_throws_table(path, plan)
    numbers, planned = table["trial"].to_pylist(), plan.trials.numbers
    if (directory / SOURCES).exists():
        if numbers != sorted({number for number in numbers if number in planned}):
            raise DatasetError("its rows are not trials of the plan in order", path=path)
    elif numbers != list(planned):
        raise DatasetError(f"its rows are not the {len(plan.trials)} trials of the plan in order", path=path)
    if problem := _explain_unusable(table, plan):
        raise DatasetError(problem, path=path)
    return table


def _explain_unusable(table: pa.Table, plan: Plan) -> str | None:
    """Say what makes a table unusable, as it may come from anybody; None if it is usable, even with wrong numbers."""
    known = {
        "outcome": {REFUSED, *(each.value for each in task_of(plan.config).outcomes)},
        "shard": {None, *list_shards(plan)},
    }
    for name, values in known.items():
        if unknown := count_values(table[name]).keys() - values:
            return f"{name} is {min(map(repr, unknown))} in some row, which no row of this plan can have"
    places = ("shard", "chunk_offset", "samples", "digest")
    shard, *rest = (read_validity(table[name].combine_chunks()) for name in places)
    if not all(np.array_equal(each, shard) for each in rest):
        return "some row has only a part of the place of an episode"
    samples = find_range(table["samples"])
    if samples is not None and samples[0] < 1:
        return "some row has an episode without samples"
    return None
