"""A dataset as people read it: a sequence of throws beside the table of throws."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.config.schema import Config
from throwcollect.dataset.columns import COLUMNS, Place
from throwcollect.dataset.data_card import count_outcomes
from throwcollect.dataset.expression import Expression
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.trajectories import Trajectories, read_trajectories
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.talos import JOINTS
from throwcollect.wording import counted

_SELECTION = "a condition, an Arrow expression, a mask, or numbers of trials"


@dataclass(frozen=True, eq=False, repr=False)
class ThrowDataset(Sequence[Throw]):
    """Throws of a dataset, in order of trials unless they were selected in another one.

    ``dataset[i]`` is the throw of row i of `throws`. A dataset as it is loaded has every trial of the plan, so there i
    is the number of the trial; trials that were refused or lost have a row, too, but no trajectory (see `recorded`).

    May be shared by threads and sent to other processes. No file stays open.

    Attributes:
        directory: Where the dataset is.
        config: Its configuration; that of a single trial has `Throw.parameters` in it.
        parameters: Swept dotted configuration keys, which are columns of `throws`.
        throws: One row a throw; ``docs/dataset.md`` describes the columns.
    """

    directory: Path
    config: Config
    parameters: tuple[str, ...]
    throws: pa.Table

    def __len__(self) -> int:
        return len(self.throws)

    @overload
    def __getitem__(self, which: int) -> Throw: ...
    @overload
    def __getitem__(self, which: slice) -> ThrowDataset: ...
    def __getitem__(self, which: int | slice) -> Throw | ThrowDataset:
        """A throw by its position, or the throws of a slice.

        Raises:
            IndexError: If there are not so many.
        """
        if isinstance(which, slice):
            return self._taken(range(len(self))[which])
        if not -len(self) <= which < len(self):
            raise IndexError(f"{self.directory}: no throw {which} of {len(self)}")
        position = which % len(self)
        return Throw(self.throws, position, self.parameters, self._places[position], str(self.directory))

    def __iter__(self) -> Iterator[Throw]:
        return (self[position] for position in range(len(self)))

    def __repr__(self) -> str:
        outcomes = ", ".join(f"{count} {outcome}" for outcome, count in count_outcomes(self.throws).items())
        swept = ", ".join(self.parameters)
        return f"ThrowDataset({str(self.directory)!r}: {counted(len(self), 'throw')}: {outcomes}; swept: {swept})"

    @property
    def recorded(self) -> ThrowDataset:
        """The throws that have a trajectory: all but the refused and the lost."""
        return self._with(self.throws.filter(pc.is_valid(self.throws["shard"])))

    def select(self, which: str | Iterable[Any]) -> ThrowDataset:
        """Some of the throws.

        Args:
            which: A condition on the columns of `throws` as `throwcollect dataset filter` takes it, such as
                ``"outcome == 'landed' and landing_x_m > 1.5"``; an Arrow expression on them; a mask with one boolean
                for each throw; or numbers of trials, in the order in which they are wanted.

        Raises:
            ConfigError: If it is none of these.
            DatasetError: If a trial is not among the throws.
        """
        if isinstance(which, str):
            return self._taken(Expression(which, place="select").rows(self.throws))
        if isinstance(which, pc.Expression):
            try:
                return self._with(self.throws.filter(which))
            except pa.ArrowException as error:
                raise ConfigError(f"select: {str(error).splitlines()[0]}") from error
        values = _as_array(which)
        if pa.types.is_boolean(values.type):
            if len(values) != len(self):
                raise ConfigError(
                    f"select: a mask of {len(values)}", expected=f"one boolean for each of {len(self)} throws"
                )
            return self._with(self.throws.filter(values))
        rows = pc.index_in(values.cast(pa.int64()), value_set=self.throws["trial"].combine_chunks())
        if rows.null_count:
            missing = values.filter(pc.is_null(rows))[0]
            raise DatasetError(f"{self.directory}: no trial {missing} among the {len(self)} throws")
        return self._with(self.throws.take(rows))

    def trajectories(
        self, columns: Iterable[str] = COLUMNS, *, joints: Iterable[str] = JOINTS, threads: int | None = None
    ) -> Trajectories:
        """Read the trajectories of all throws into one array for each column.

        Args:
            columns: Which of `COLUMNS`; nothing else is copied.
            joints: Joints that the columns of joints have, in this order; `moving_joints` leaves out the constant ones.
            threads: How many of them work; None for one a core, up to 4.

        Raises:
            ConfigError: If there is no such column or joint.
            DatasetError: If an episode is not where the table says, or it is damaged; CRCs are compared.
        """
        trials = self.throws["trial"].to_pylist()
        return read_trajectories(trials, self._places, tuple(columns), tuple(joints), threads=threads)

    @property
    def moving_joints(self) -> tuple[str, ...]:
        """Joints that the task moves; all others hold still."""
        return tuple(self.config.task.end)

    @cached_property
    def _places(self) -> Sequence[Place | None]:
        columns = (self.throws[name].to_pylist() for name in ("trial", "shard", "chunk_offset", "samples"))
        rows = list(zip(*columns, strict=True))
        paths = {
            name: self.directory / Path(name).name for name in {shard for _, shard, *_ in rows} if name is not None
        }
        start_ns = self.config.trial_start_ns
        return [
            None if shard is None else Place(trial, start_ns(trial), paths[shard], offset, samples)
            for trial, shard, offset, samples in rows
        ]

    def _taken(self, rows: Iterable[int]) -> ThrowDataset:
        return self._with(self.throws.take(pa.array(rows, pa.int64())))

    def _with(self, throws: pa.Table) -> ThrowDataset:
        return ThrowDataset(self.directory, self.config, self.parameters, throws)


def _as_array(which: Any) -> pa.Array:
    """An Arrow array of booleans or integers, whatever holds them."""
    if isinstance(which, pa.ChunkedArray):
        which = which.combine_chunks()
    try:
        values = which if isinstance(which, pa.Array) else pa.array(which if hasattr(which, "__len__") else list(which))
    except (pa.ArrowException, TypeError) as error:
        raise ConfigError(f"select: {error}", expected=_SELECTION) from error
    if not len(values):
        return pa.array([], pa.int64())
    if not (pa.types.is_boolean(values.type) or pa.types.is_integer(values.type)):
        raise ConfigError(f"select: values of type {values.type}", expected=_SELECTION)
    return values


def load(directory: str | os.PathLike[str]) -> ThrowDataset:
    """Open a finished dataset for reading.

    Its tables are read and checked against each other; recordings are opened when they are looked at.

    Args:
        directory: Its directory.

    Raises:
        DatasetError: If the directory holds no dataset, an unfinished one, or one whose tables are damaged.
        ConfigError: If its ``config.yaml`` is wrong.
    """
    dataset = Dataset.open(Path(directory))
    return ThrowDataset(dataset.directory, dataset.config, dataset.plan.keys, dataset.throws)
