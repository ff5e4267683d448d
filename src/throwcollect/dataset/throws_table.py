"""The table of throws: one row a trial, with its swept values, its result, and the place of its episode.

`judge_episode` finds the result from an episode, by the rules of the coordinator.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.config.shape import unit_of_key
from throwcollect.config.values import column_of
from throwcollect.dataset.directory import SOURCES, THROWS, list_shards
from throwcollect.dataset.misses import Misses
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.members import explain_failure
from throwcollect.plan.arrow_column import find_trial, make_table, read_validity
from throwcollect.plan.parquet_file import read_parquet
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import Trial
from throwcollect.robots.description import robot_of
from throwcollect.tasks.result import REFUSED, Result
from throwcollect.tasks.result_columns import BodyColumns, ObjectState
from throwcollect.tasks.task import task_of, trajectory_of
from throwcollect.units import ascii_unit, unit_of_name

Row = dict[str, Any]
"""A row of the table, by column; what is null there is None."""

_KINDS = {"number": pa.float64(), "count": pa.int64(), "text": pa.string()}
"""Types of the columns that tasks declare."""
_STATE = BodyColumns("")


def judge_episode(config: Config, episode: Episode) -> Result:
    """Find the result of a trial with this configuration from its episode."""
    samples = episode.samples(robot_of(config).joints)
    if (np.diff(samples.stamps_ns) <= 0).any():
        raise DatasetError("chunk: the stamps do not increase")
    with explain_failure("tasks", config.task.name, f"judge trial {episode.header.trial}"):
        result: Result = task_of(config).judge(samples, episode.header, trajectory_of(config))
    return result


def place_columns(shard: str, chunk_offset: int, episode: Episode) -> Row:
    """Make the columns that say where an episode lies, with the offset of its chunk [bytes], and which one it is."""
    samples, digest = episode.header.samples, episode.digest
    return {"shard": shard, "chunk_offset": chunk_offset, "samples": samples, "digest": digest}


def make_field(name: str, kind: pa.DataType, description: str, *, unit: str | None = None) -> pa.Field:
    """Make a column of a table, with its description for people; numbers have a unit, by default that of the name."""
    metadata = {"description": description}
    if kind != pa.string():
        metadata["unit"] = ascii_unit(unit_of_name(name) if unit is None else unit)
    return pa.field(name, kind, metadata=metadata)


def body_state(row: Row, name: str) -> ObjectState | None:
    """Read the state of the object at ``release``, ``apex`` or ``landing`` from a row of the table of throws.

    It is None if the trial came to no such event, or its task knows none.
    """
    values: list[Any] = [row.get(column.name) for column in _STATE.declare(name, ())]
    return None if None in values else ObjectState(values[0], tuple(values[1:4]), tuple(values[4:]))


class ThrowsTable:
    """The schema of one collection's table; turns results into rows.

    Attributes:
        columns: Columns with their types.

    The parameters are the swept keys, and the targets columns of targets, in their order.
    """

    def __init__(self, parameters: Sequence[str], config: Config, targets: Sequence[str] = ()) -> None:
        self._parameters = tuple(parameters)
        self._misses = Misses(config, targets)
        task = task_of(config)
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
        if twice := [column for column, count in Counter(self.columns.names).items() if count > 1]:
            raise ConfigError(
                f"task.name: two columns of the table of throws of the task {task.config.task.name} have the same "
                f"name: {', '.join(twice)}",
                hint="rename the fields of its results; a swept key has underscores in place of dots",
            )

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

    def row(self, trial: Trial, result: Result, place: Row | None) -> Row:
        """Make the row of a trial that was run; `place` are its `place_columns`, None if it has no episode."""
        return self.join(trial, self._columns.write(result), place)

    def join(self, trial: Trial, result: Row, place: Row | None) -> Row:
        """Make the row of a trial as `row` does, from the columns of its result (`ResultColumns.write`)."""
        row = self.start_row(trial) | result
        row.update(self._misses.measure(trial.target, row))
        return row | (place or {})

    def make_refused_row(self, trial: Trial) -> Row:
        """Make the row of a trial that the plan refused."""
        return {**self.start_row(trial), "outcome": REFUSED, "reason": trial.refused}

    def start_row(self, trial: Trial) -> Row:
        """Make the columns of a row that follow from the plan."""
        values = {column_of(key): trial.values[key] for key in self._parameters}
        return {"trial": trial.number, **values, **trial.target}

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
    counts = Counter(throws["outcome"].to_pylist())
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def find_row(table: pa.Table, trial: int) -> Row | None:
    """Read the row of a trial from a table of throws; None if it has none."""
    position = find_trial(table["trial"], trial)
    return None if position < 0 else table.slice(position, 1).to_pylist()[0]


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
    # Names of recordings become paths.
    if unknown := set(table["shard"].to_pylist()) - {None, *list_shards(plan)}:
        raise DatasetError(f"shard is {min(unknown)!r} in some row, which no row of this plan can have", path=path)
    # Where a trial has no episode, all columns of its place are null.
    places = table.select(["shard", "chunk_offset", "samples", "digest"])
    there = np.array([read_validity(column.combine_chunks()) for column in places.columns])
    if (wrong := np.flatnonzero(there.any(axis=0) & ~there.all(axis=0))).size:
        raise DatasetError("has only a part of the place of an episode", path=path, place=f"row {wrong[0] + 1}")
    return table
