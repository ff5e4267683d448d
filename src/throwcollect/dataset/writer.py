"""Fills a dataset: from a frozen plan and episodes in any order to files that depend on nothing but the plan.

A directory that holds ``config.yaml`` and ``plan.parquet`` is a created dataset; one that also holds ``metadata.yaml``
is finished, as that file is written last. While a dataset is filled, each open shard lies beside its final name (see
`shard`), and each finished shard's rows are kept for ``throws.parquet``.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from throwcollect.config.loader import load, resolved_yaml
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary, bag_information, to_yaml
from throwcollect.dataset.card import Provenance, data_card
from throwcollect.dataset.digest import combined_digest
from throwcollect.dataset.directory import CARD, CONFIG, FORMAT, METADATA, PLAN, THROWS, shard_name
from throwcollect.dataset.files import write_file
from throwcollect.dataset.shard import OpenShard
from throwcollect.dataset.throws import Place, Row, ThrowsTable, encode_table
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.description import full_description
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.throw import Outcome, ThrowResult


def create(directory: Path, plan: Plan) -> None:
    """Write the directory of a dataset of which no trial has run yet.

    Args:
        directory: Must not exist, or be empty.
        plan: The trials and their configuration.

    Raises:
        ConfigError: If the directory holds files already, or cannot be made.
        DatasetError: If the files cannot be written; nothing is left behind then.
    """
    made = not directory.exists()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        taken = sorted(path.name for path in directory.iterdir())
    except OSError as error:
        raise ConfigError(f"{directory}: cannot be used as directory of a dataset: {error.strerror}") from error
    if taken:
        raise ConfigError(
            f"{directory}: holds {', '.join(taken[:3])}{' and more' if taken[3:] else ''}",
            expected="a directory that is new or empty",
            hint="choose another one with --output",
        )
    with ExitStack() as undo:
        undo.callback(_clear, directory, remove=made)
        write_file(directory / CONFIG, resolved_yaml(plan.config).encode())
        plan.write(directory / PLAN)
        undo.pop_all()


def _clear(directory: Path, *, remove: bool) -> None:
    with suppress(OSError):
        for path in directory.iterdir():
            path.unlink()
        if remove:
            directory.rmdir()


class _Finished(NamedTuple):
    """What is kept of a finished shard."""

    summary: FileSummary | None
    rows: pa.Table


class DatasetWriter:
    """Takes the episodes of a plan's trials, each once and in any order, and writes the dataset.

    Attributes:
        plan: The trials.

    Args:
        directory: A directory as `create` leaves it.
        plan: The plan that lies there.
    """

    def __init__(self, directory: Path, plan: Plan) -> None:
        self.plan = plan
        self._directory = directory
        self._config: Config = plan.config
        self._channels = Channels(self._config, full_description(self._config))
        self._trials = {trial.number: trial for trial in plan.trials}
        self._table = ThrowsTable(plan.keys, tuple(self._config.task.end))
        self._shards: dict[int, OpenShard] = {}
        self._rows: dict[int, dict[int, Row]] = {}
        self._finished: dict[int, _Finished] = {}
        members: dict[int, list[int]] = {}
        for number in self._trials:
            members.setdefault(number // self._config.record.trials_per_shard, []).append(number)
        for shard, numbers in members.items():
            runnable = [number for number in numbers if self._trials[number].refused is None]
            path = directory / shard_name(self._config.name, shard)
            self._shards[shard] = OpenShard(path, runnable, self._channels)
            self._rows[shard] = {
                number: self._table.refused_row(number, trial.values, trial.refused)
                for number in numbers
                if (trial := self._trials[number]).refused is not None
            }
        for shard in members:
            self._finish_shard_if_complete(shard)

    @classmethod
    def create(cls, directory: Path, plan: Plan) -> DatasetWriter:
        """Create a dataset and open it.

        Raises:
            ConfigError: If the directory holds files already, or cannot be made.
            DatasetError: If the files cannot be written; nothing is left behind then.
        """
        create(directory, plan)
        return cls(directory, plan)

    @classmethod
    def open(cls, directory: Path) -> DatasetWriter:
        """Open a directory as `create` leaves it.

        Raises:
            DatasetError: If it is not one, or trials of it have run already.
            ConfigError: If its ``config.yaml`` is wrong.
        """
        for name in (CONFIG, PLAN):
            if not (directory / name).is_file():
                raise DatasetError(f"{directory}: holds no {name}", expected="a dataset that was created")
        if used := sorted(path.name for path in directory.iterdir() if path.name == METADATA or ".mcap" in path.name):
            raise DatasetError(f"{directory}: trials of it have run already: it holds {used[0]}")
        return cls(directory, Plan.read(directory / PLAN, load(directory / CONFIG)))

    def append(self, episode: Episode, result: ThrowResult) -> None:
        """Write an episode.

        Args:
            episode: The episode.
            result: What came of it.

        Raises:
            DatasetError: If the episode is damaged, is of no trial that is waited for, or cannot be written.
        """
        number = episode.header.trial
        shard = self._waiting_shard(number)
        self._shards[shard].append(episode)
        place = Place(shard_name(self._config.name, shard), -1, episode.header.samples, episode.digest)
        self._rows[shard][number] = self._table.row(number, self._trials[number].values, result, place)
        self._finish_shard_if_complete(shard)

    def append_lost(self, trial: int, reason: str) -> None:
        """Write that a trial has no episode.

        Args:
            trial: Number of the trial.
            reason: Why.

        Raises:
            DatasetError: If the trial is not waited for, or the shard that it completes cannot be written.
        """
        shard = self._waiting_shard(trial)
        self._shards[shard].missing.remove(trial)
        result = ThrowResult(Outcome.LOST, reason=reason)
        self._rows[shard][trial] = self._table.row(trial, self._trials[trial].values, result, None)
        self._finish_shard_if_complete(shard)

    def finish(self, *, wall_s: float, simulations: int | None = None) -> None:
        """Write everything that describes the dataset as a whole; ``metadata.yaml`` comes last.

        Args:
            wall_s: Real time that the collection took [s], for the data card.
            simulations: Number of simulations that took part, for the data card; None if that is not known.

        Raises:
            DatasetError: If trials are missing, or a file cannot be written.
        """
        if self._shards:
            missing = sorted(number for shard in self._shards.values() for number in shard.missing)
            raise DatasetError(f"{self._directory}: {len(missing)} trials are missing, such as {missing[0]}")
        finished = [self._finished[shard] for shard in sorted(self._finished)]
        throws = pa.concat_tables([each.rows for each in finished])
        digest = combined_digest(throws["digest"].drop_null().to_pylist())
        files = [each.summary for each in finished if each.summary]
        custom = {"throwcollect.format": FORMAT, "throwcollect.digest": digest}
        metadata = {"rosbag2_bagfile_information": bag_information(files, self._channels.all, custom)}
        provenance = Provenance.of_this_machine(simulations=simulations, wall_s=wall_s)
        # How it was run may not change the dataset, so what is kept of that is in the data card alone.
        config = self._config.without_run()
        write_file(self._directory / THROWS, encode_table(throws))
        write_file(self._directory / CARD, data_card(config, throws, provenance).encode())
        write_file(self._directory / CONFIG, resolved_yaml(config).encode())
        write_file(self._directory / METADATA, to_yaml(metadata).encode())

    def close(self) -> None:
        """Close all files; what is written stays."""
        for shard in self._shards.values():
            shard.close()

    def _waiting_shard(self, trial: int) -> int:
        shard = trial // self._config.record.trials_per_shard
        if shard not in self._shards or trial not in self._shards[shard].missing:
            raise DatasetError(f"{self._directory}: no episode of trial {trial} is waited for")
        return shard

    def _finish_shard_if_complete(self, number: int) -> None:
        shard = self._shards[number]
        if shard.missing:
            return
        finished = shard.finish()
        rows = [row for _, row in sorted(self._rows.pop(number).items())]
        if finished is not None:
            for row in rows:
                row["chunk_offset"] = finished.offsets.get(row["trial"])
        self._finished[number] = _Finished(finished.summary if finished else None, self._table.table(rows))
        del self._shards[number]
