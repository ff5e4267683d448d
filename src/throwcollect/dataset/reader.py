"""Reads a dataset: a sequence of throws, its table of throws, and the episodes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.section import unknown_joint
from throwcollect.dataset.bag import read_bag_metadata
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import FORMAT, METADATA, PLAN, THROWS
from throwcollect.dataset.mcap_reader import EpisodePlace, open_mcap
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.throws_table import count_outcomes, read_throws
from throwcollect.dataset.trajectories import Trajectories, list_columns, read_trajectories
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.extras import lazily
from throwcollect.files import StrPath
from throwcollect.plan.arrow_column import find_trial
from throwcollect.plan.plan import Plan
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from pandas import DataFrame

pd = lazily("pandas")


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(Sequence[Throw]):
    """Throws of a dataset, in order of trials unless they were selected in another one.

    ``dataset[i]`` is the throw of row i of `throws`. A dataset that was collected has every trial of the plan, so i is
    the number of the trial; trials that were refused or lost have a row, too, but no trajectory (see `recorded`). A
    dataset that was derived has only the trials that were taken, with their numbers.

    May be shared by threads and sent to other processes. No file stays open.

    Attributes:
        directory: Where the dataset is.
        plan: All its trials, also of those that were not selected.
        throws: One row a throw; ``docs/dataset.md`` describes the columns.
    """

    directory: Path
    plan: Plan
    throws: pa.Table
    _bag: Mapping[str, Any]

    @classmethod
    def open(cls, directory: StrPath) -> Dataset:
        """Open a finished dataset for reading.

        Its tables are read and checked against each other; recordings are opened when they are looked at.

        Raises:
            DatasetError: If the directory holds no dataset, an unfinished one, or one whose tables are damaged.
            ConfigError: If its ``config.yaml`` is wrong.
        """
        path = Path(directory)
        try:
            bag = read_bag_metadata(path)
            if (found := _find_custom(bag, "throwcollect.format")) != FORMAT:
                raise DatasetError(f"has the format {found}", path=path, expected=FORMAT)
            plan = Plan.read(path / PLAN, read_config(path))
            if not (path / THROWS).exists():
                raise DatasetError("is missing", path=path / THROWS)
            return cls(path, plan, read_throws(path, plan), bag)
        except DatasetError as error:
            # All of these follow from the configuration and the recordings.
            if error.path in (path / METADATA, path / PLAN, path / THROWS):
                error.hint = error.hint or command("resume", path)
            raise

    def __len__(self) -> int:
        return len(self.throws)

    @overload
    def __getitem__(self, which: int) -> Throw: ...
    @overload
    def __getitem__(self, which: slice) -> Dataset: ...
    @overload
    def __getitem__(self, which: str) -> NDArray[Any]: ...
    def __getitem__(self, which: int | slice | str) -> Throw | Dataset | NDArray[Any]:
        """Return a throw by its position, the throws of a slice, or a column of `throws` by its name.

        A column is an array with one value a throw; a number that is missing is NaN, a string None.

        Raises:
            IndexError: If there is no throw at this position.
            KeyError: If there is no such column.
            TypeError: If it is none of these.
        """
        if isinstance(which, str):
            return _read_column(self.throws[which])
        if isinstance(which, slice):
            return replace(self, throws=self.throws.take(pa.array(range(len(self))[which], pa.int64())))
        position = range(len(self))[which]
        return Throw(self.throws, position, self.plan.keys, self._stored[position], str(self.directory), self.config)

    def __contains__(self, column: object) -> bool:
        return column in self.throws.column_names

    def __iter__(self) -> Iterator[Throw]:
        return (self[position] for position in range(len(self)))

    def __repr__(self) -> str:
        outcomes = ", ".join(f"{count} {outcome}" for outcome, count in count_outcomes(self.throws).items())
        swept = ", ".join(self.plan.keys)
        return f"Dataset({str(self.directory)!r}: {format_count(len(self), 'throw')}: {outcomes}; swept: {swept})"

    @property
    def config(self) -> Config:
        """Its configuration; that of a single throw is `Throw.config`."""
        return self.plan.config

    def to_pandas(self) -> DataFrame:
        """Convert the table of throws to a DataFrame, one row a throw, with the number of the trial as its index.

        Raises:
            MissingExtraError: If pandas is not installed.
        """
        return pd.DataFrame({name: self[name] for name in self.throws.column_names}).set_index("trial")

    @property
    def digest(self) -> str:
        """Hash over all episodes in order of trials, as it was written.

        Raises:
            DatasetError: If the metadata do not have it.
        """
        digest = _find_custom(self._bag, "throwcollect.digest")
        if not isinstance(digest, str):
            raise DatasetError("throwcollect.digest is missing", path=self.directory / METADATA)
        return digest

    @property
    def shards(self) -> tuple[str, ...]:
        """Names of the recordings that its throws are in, in order."""
        return tuple(sorted(set(self.throws["shard"].to_pylist()) - {None}))

    @property
    def topics(self) -> Mapping[str, int]:
        """Number of messages of each topic in the whole dataset, as it was written.

        Raises:
            DatasetError: If the metadata do not have them.
        """
        try:
            counts = self._bag["topics_with_message_count"]
            return {str(each["topic_metadata"]["name"]): int(each["message_count"]) for each in counts}
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise DatasetError("topics_with_message_count are missing", path=self.directory / METADATA) from error

    @property
    def recorded(self) -> Dataset:
        """The throws that have a trajectory: all but the refused and the lost."""
        return replace(self, throws=self.throws.filter(self.throws["shard"].is_valid()))

    def throw(self, trial: int) -> Throw:
        """Return the throw of a trial by its number.

        Raises:
            DatasetError: If the trial is not among the throws.
        """
        position = find_trial(self.throws["trial"], trial)
        if position < 0:
            raise DatasetError(f"no trial {trial}", path=self.directory)
        return self[position]

    def episode(self, trial: int) -> Episode:
        """Read the episode of a trial by its number, with everything that was recorded.

        Raises:
            DatasetError: If the trial is not among the throws, has no episode, or it is not at the place in the table.
        """
        return self.throw(trial).read_episode()

    def robot_description(self) -> str | None:
        """Read the URDF of the robot from the first recording; None if there is no recording.

        Raises:
            DatasetError: If that recording is missing or damaged.
        """
        first = next((stored.path for stored in self._stored if stored is not None), None)
        if first is None:
            return None
        with open_mcap(first) as contents:
            try:
                return contents.read_robot_description()
            except DatasetError as error:
                raise error.locate(first) from error

    def episodes(self) -> Iterator[Episode]:
        """Read the episodes of the throws that have one, in the order of the throws.

        Raises:
            DatasetError: If an episode is not at its place in the table.
        """
        return (stored.read() for stored in self._stored if stored is not None)

    def select(self, which: str | Iterable[Any]) -> Dataset:
        """Select some of the throws.

        Args:
            which: A condition on the columns of `throws` as `throwcollect dataset filter` takes it, such as
                ``"outcome == 'landed' and landing_x_m > 1.5"``; an Arrow expression on them; a mask with one boolean
                for each throw; or numbers of trials, in the order in which they are wanted.

        Raises:
            ConfigError: If the condition cannot be evaluated.
            ValueError: If Arrow takes it for none of these, such as a mask that is too short.
            DatasetError: If a trial is not among the throws.
        """
        # Arrow's functions take long to import, and most programs that open a dataset select nothing.
        from throwcollect.dataset.selection import select_throws

        return replace(self, throws=select_throws(self.throws, which, self.directory))

    def trajectories(
        self,
        columns: Iterable[str] | None = None,
        *,
        joints: Iterable[str] | None = None,
        threads: int | None = None,
    ) -> Trajectories:
        """Read the trajectories of all throws into one array for each column.

        Args:
            columns: Which columns (``docs/dataset.md``); nothing else is copied. None for all.
            joints: Joints that the columns of joints have, in this order; None for all. `moving_joints` leaves out the
                constant ones.
            threads: How many threads read; None for one for each core, up to 4.

        Raises:
            ConfigError: If there is no such column or joint.
            DatasetError: If an episode is not at its place in the table, or it is damaged; CRCs are compared.
        """
        trials, known = self.throws["trial"].to_pylist(), self.joints
        chosen = known if joints is None else tuple(joints)
        for joint in chosen:
            if joint not in known:
                raise ConfigError(unknown_joint(joint, robot_of(self.config)))
        bodies = moving_bodies_of(self.config)
        wanted = tuple(list_columns(bodies) if columns is None else columns)
        return read_trajectories(trials, self._stored, wanted, known, bodies, chosen, threads=threads)

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints of the robot, in the order of the columns of joints."""
        return robot_of(self.config).joints

    @property
    def moving_joints(self) -> tuple[str, ...]:
        """Joints that the task moves, in the order of `joints`, as exports have them; all others hold still."""
        return self.config.moving_joints

    @cached_property
    def _stored(self) -> Sequence[EpisodePlace | None]:
        """Where the episode of each throw lies; None where there is none."""
        columns = (self.throws[name].to_pylist() for name in ("trial", "shard", "chunk_offset", "samples"))
        rows = list(zip(*columns, strict=True))
        paths = {name: self.directory / name for name in {shard for _, shard, *_ in rows} if name is not None}
        start_ns, first = self.config.trial_start_ns, self.plan.first_of_part
        return [
            None if shard is None else EpisodePlace(paths[shard], offset, start_ns(trial - first(trial)), samples)
            for trial, shard, offset, samples in rows
        ]


def load(directory: StrPath) -> Dataset:
    """Open a finished dataset for reading; see `Dataset.open`."""
    return Dataset.open(directory)


def _read_column(column: pa.ChunkedArray) -> NDArray[Any]:
    """Copy a column of a table into an array, one value a row; a number that is missing is NaN, a string None."""
    if pa.types.is_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    if column.null_count:
        column = column.cast(pa.float64()).fill_null(np.nan)
    return np.array(column.to_numpy())


def _find_custom(bag: Mapping[str, Any], name: str) -> object:
    """Find what the product itself wrote into the metadata of a bag under a name; None if it is not there."""
    custom = bag.get("custom_data")
    return custom.get(name) if isinstance(custom, dict) else None
