"""Reads a finished dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import from_yaml
from throwcollect.dataset.directory import METADATA, PLAN, THROWS, config_path
from throwcollect.dataset.mcap_reader import opened
from throwcollect.dataset.throws_table import read_throws_table
from throwcollect.episode.message import Episode
from throwcollect.errors import DatasetError
from throwcollect.sweep.plan import Plan


@dataclass(frozen=True)
class Dataset:
    """A finished dataset.

    Attributes:
        directory: Where it is.
        config: Its configuration.
        plan: Its trials.
        throws: One row a trial, in order; see ``docs/dataset.md``.
        bag: Fields of the rosbag2 metadata.
    """

    directory: Path
    config: Config
    plan: Plan
    throws: pa.Table
    bag: Mapping[str, Any]

    @classmethod
    def open(cls, directory: Path) -> Dataset:
        """Open a dataset.

        Args:
            directory: Its directory.

        Raises:
            DatasetError: If the directory holds no dataset, an unfinished one, or one whose tables are damaged.
            ConfigError: If its ``config.yaml`` is wrong.
        """
        bag = read_bag_metadata(directory)
        config = load(config_path(directory))
        plan = Plan.read(directory / PLAN, config)
        return cls(directory, config, plan, read_throws(directory, plan), bag)

    def __len__(self) -> int:
        return int(pc.count(self.throws["digest"]).as_py())

    def __iter__(self) -> Iterator[Episode]:
        """Episodes in order of trials, without the trials that have none.

        Raises:
            DatasetError: If an episode is not where the table says.
        """
        for row in self.throws.select(["trial", "shard", "chunk_offset"]).to_pylist():
            if row["shard"] is not None:
                yield self._read(**row)

    def episode(self, trial: int) -> Episode:
        """The episode of a trial.

        Args:
            trial: Its number.

        Raises:
            DatasetError: If the trial has no episode, or it is not where the table says.
        """
        if not 0 <= trial < len(self.throws):
            raise DatasetError(f"{self.directory}: no trial {trial}", expected=f"0 to {len(self.throws) - 1}")
        row = self.throws.slice(trial, 1).to_pylist()[0]
        if row["shard"] is None:
            raise DatasetError(f"{self.directory}: trial {trial} has no episode: {row['outcome']}: {row['reason']}")
        return self._read(trial, row["shard"], row["chunk_offset"])

    def _read(self, trial: int, shard: str, chunk_offset: int) -> Episode:
        path = self.directory / Path(shard).name
        with opened(path) as contents:
            try:
                episode = contents.episode(chunk_offset).episode
            except DatasetError as error:
                raise DatasetError(f"{path}: {error}") from error
        if episode.header.trial != trial:
            raise DatasetError(f"{path}: byte {chunk_offset}: trial {episode.header.trial}", expected=f"trial {trial}")
        return episode


def read_bag_metadata(directory: Path) -> Mapping[str, Any]:
    """Fields of the rosbag2 metadata of a finished dataset.

    Raises:
        DatasetError: If the directory holds no dataset or an unfinished one, or ``metadata.yaml`` is damaged.
    """
    path = directory / METADATA
    if not path.exists():
        if (directory / PLAN).is_file():
            raise DatasetError(f"{directory}: the dataset is not finished: it has no {METADATA}")
        raise DatasetError(f"{directory}: holds no dataset")
    bag = from_yaml(path).get("rosbag2_bagfile_information")
    if not isinstance(bag, dict):
        raise DatasetError(f"{path}: not the metadata of a rosbag2 bag")
    return bag


def read_throws(directory: Path, plan: Plan) -> pa.Table:
    """The table of throws.

    Raises:
        DatasetError: If the table is missing or damaged, or is not one of this plan.
    """
    path = directory / THROWS
    table = read_throws_table(path, plan)
    if table["trial"].to_pylist() != [trial.number for trial in plan.trials]:
        raise DatasetError(f"{path}: its rows are not the {len(plan.trials)} trials of the plan in order")
    return table
