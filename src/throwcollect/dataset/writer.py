"""Fills a dataset: from a frozen plan and episodes in any order to files that depend on nothing but the plan.

A directory that holds ``config.yaml`` and ``plan.parquet`` is a created dataset; one that also holds ``metadata.yaml``
is finished, as that file is written last. While a dataset is filled, each open shard lies beside its final name (see
`shard`), and each finished shard's rows are kept for ``throws.parquet``. Whatever ends that, the next writer takes in
what is there (see `recovery`) and goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.data_card import data_card
from throwcollect.dataset.description import write_description
from throwcollect.dataset.directory import (
    CARD,
    CONFIG,
    MANIFEST,
    METADATA,
    PLAN,
    THROWS,
    TRIALS,
    config_path,
    shard_name,
)
from throwcollect.dataset.journal import Event, Journal, was_open
from throwcollect.dataset.lock import hold_alone, hold_together
from throwcollect.dataset.manifest import FileEntry
from throwcollect.dataset.provenance import Provenance, write_provenance
from throwcollect.dataset.recovery import find_left, recover_shard, remove_unfinished
from throwcollect.dataset.shard import FinishedShard, OpenShard
from throwcollect.dataset.throws_table import Place, Row, ThrowsTable
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import remove, write_file
from throwcollect.robots.description import full_description
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.sweep.point_file import encode_points
from throwcollect.sweep.points import Points
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of
from throwcollect.wording import command, format_count

Tell = Callable[[int, Result], None]
"""Receives the number of a trial and its result."""


def create(directory: Path, plan: Plan, *, listed: Points | None = None) -> None:
    """Write the directory of a dataset of which no trial has run yet.

    Args:
        directory: Must not exist, or be empty.
        plan: The trials and their configuration.
        listed: Points that the sampler of the configuration is to find in ``trials.parquet``; None if it does not.

    Raises:
        ConfigError: If the directory holds files already, or cannot be made.
        DatasetError: If the files cannot be written; nothing is left behind then.
    """
    try:
        made = not directory.exists()
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, RecursionError) as error:
        raise _unusable(directory, error) from error
    with hold_alone(directory, needed=False):
        _fill(directory, plan, listed, made=made)


def _fill(directory: Path, plan: Plan, listed: Points | None, *, made: bool) -> None:
    try:
        taken = sorted(path.name for path in directory.iterdir())
    except OSError as error:
        raise _unusable(directory, error) from error
    if taken:
        begun = PLAN in taken or CONFIG in taken
        raise ConfigError(
            f"{directory}: holds {', '.join(taken[:3])}{' and more' if taken[3:] else ''}",
            expected="a directory that is new or empty",
            hint="choose another one with --output" + (f", or go on: {command('resume', directory)}" if begun else ""),
        )
    with ExitStack() as undo:
        undo.callback(_clear, directory, remove=made)
        write_file(directory / CONFIG, dump_yaml(plan.config).encode())
        if listed is not None:
            write_file(directory / TRIALS, encode_points(listed))
        plan.write(directory / PLAN)
        undo.pop_all()


def _unusable(directory: Path, error: OSError | RecursionError) -> ConfigError:
    reason = error.strerror if isinstance(error, OSError) else "it has too many levels"
    return ConfigError(f"{directory}: cannot be used as directory of a dataset: {reason}")


def _clear(directory: Path, *, remove: bool) -> None:
    with suppress(OSError):
        for path in directory.iterdir():
            path.unlink()
        if remove:
            directory.rmdir()


class _Finished(NamedTuple):
    """What is kept of a finished shard."""

    summary: FileSummary | None
    entry: FileEntry | None
    rows: pa.Table


class DatasetWriter:
    """Takes the episodes of a plan's trials, each once and in any order, and writes the dataset.

    Attributes:
        plan: The trials.

    Args:
        directory: A directory as `create` leaves it.
        plan: The plan that lies there.
        journal: Receives what happens; None for datasets that are written in one go.
        growing: Whether trials may still be added to the plan, until `close_plan`.
        channels: What is recorded; None for what the robot that is installed here gives.
    """

    def __init__(
        self,
        directory: Path,
        plan: Plan,
        *,
        journal: Journal | None = None,
        growing: bool = False,
        channels: Channels | None = None,
    ) -> None:
        self.plan = plan
        self._directory = directory
        self._config: Config = plan.config
        self._journal = journal
        self._growing = growing
        self._channels = channels or Channels(self._config, full_description(self._config))
        self._table = ThrowsTable.of(plan)
        self._shards: dict[int, OpenShard] = {}
        self._rows: dict[int, dict[int, Row]] = {}
        self._finished: dict[int, _Finished] = {}
        self._held = ExitStack()
        self._expect(plan.trials)

    @classmethod
    def create(cls, directory: Path, plan: Plan, *, listed: Points | None = None) -> DatasetWriter:
        """Create a dataset and open it; see the function `create`.

        Raises:
            ConfigError: If the directory holds files already, or cannot be made.
            DatasetError: If the files cannot be written; nothing is left behind then.
        """
        create(directory, plan, listed=listed)
        return cls(directory, plan)

    @classmethod
    def open(cls, directory: Path) -> DatasetWriter:
        """Open a dataset to collect into, and keep all others from doing so; call `recover` next.

        Raises:
            DatasetError: If the directory holds no plan of its configuration, or another process collects into it.
            ConfigError: If its ``config.yaml`` is wrong.
        """
        for name in (CONFIG, PLAN):
            if not (directory / name).is_file():
                raise DatasetError(f"holds no {name}", path=directory, expected="a dataset that was created")
        with ExitStack() as held:
            held.enter_context(hold_together(directory))
            journal = held.enter_context(Journal(directory))
            plan = Plan.read(directory / PLAN, load(config_path(directory)))
            writer = cls(directory, plan, journal=journal, growing=plan.config.grows)
            writer._held = held.pop_all()
        return writer

    def recover(self, tell: Tell | None = None, *, processes: int = 1) -> int:
        """Take in what earlier writers have left: every episode that is whole stays, everything else is removed.

        A finished dataset is an unfinished one then, even if all its trials have ended; `finish` writes the same files.

        Args:
            tell: Called for each trial that has an episode, in order of shards.
            processes: How many processes may look through the recordings of a large dataset, as `find_left` takes it.

        Returns:
            Number of episodes.

        Raises:
            DatasetError: If files cannot be read or written.
            WorkerError: If a process that looks through recordings is killed.
        """
        remove_unfinished(self._directory)
        for name in (METADATA, MANIFEST, THROWS):
            remove(self._directory / name)
        found = 0
        shards = dict(self._shards)
        all_left = find_left(shards, self.plan, self._channels, settled=self._settled, processes=processes)
        for (number, shard), left in zip(shards.items(), all_left, strict=True):
            recovered = recover_shard(shard, left)
            for each in recovered.episodes:
                place = Place(shard.path.name, -1, each.samples, each.digest)
                self._rows[number][each.trial] = self._row(each.trial, each.result, place)
                if tell is not None:
                    tell(each.trial, each.result)
            found += len(recovered.episodes)
            if recovered.finished is not None:
                self._close_shard(number, recovered.finished)
            else:
                self._finish_shard_if_complete(number)
        if found:
            self.note("recovered", episodes=found)
        return found

    def extend(self, trials: Sequence[Trial]) -> None:
        """Add trials to the plan, and to the one on disk before this returns.

        Args:
            trials: Numbered on from those that are there.

        Raises:
            DatasetError: If the plan cannot be written.
        """
        plan = Plan(self._config, (*self.plan.trials, *trials))
        plan.write(self._directory / PLAN)
        self.plan = plan
        self.note("planned", trials=len(plan.trials))
        self._expect(trials)

    def close_plan(self) -> None:
        """No trial will be added any more.

        Raises:
            DatasetError: If a shard that is now complete cannot be written.
        """
        self._growing = False
        for number in list(self._shards):
            self._finish_shard_if_complete(number)

    def take_shard(self, number: int, summary: FileSummary | None, entry: FileEntry | None, rows: pa.Table) -> None:
        """Take in a finished shard that lies under its name already.

        Args:
            number: Its number.
            summary: What the bag's metadata say of its file; None if there is none, as no trial of it has an episode.
            entry: What the manifest says of its file.
            rows: The rows of its trials in the table of throws.
        """
        self._shards.pop(number)
        self._rows.pop(number)
        self._finished[number] = _Finished(summary, entry, rows)

    def append(self, episode: Episode, result: Result) -> None:
        """Write an episode.

        Args:
            episode: The episode.
            result: What came of it.

        Raises:
            DatasetError: If the episode is damaged, is of no trial that is waited for, or cannot be written.
        """
        trial = episode.header.trial
        number = self._waiting_shard(trial)
        shard = self._shards[number]
        shard.append(episode)
        place = Place(shard.path.name, -1, episode.header.samples, episode.digest)
        self._rows[number][trial] = self._row(trial, result, place)
        self.note("commit", trial=trial, outcome=result.outcome.value, digest=episode.digest)
        self._finish_shard_if_complete(number)

    def append_lost(self, trial: int, reason: str) -> None:
        """Write that a trial has no episode.

        Args:
            trial: Number of the trial.
            reason: Why.

        Raises:
            DatasetError: If the trial is not waited for, or the shard that it completes cannot be written.
        """
        number = self._waiting_shard(trial)
        self._shards[number].missing.remove(trial)
        self._rows[number][trial] = self._row(trial, task_of(self._config).lose(reason), None)
        self.note("lost", trial=trial, reason=reason)
        self._finish_shard_if_complete(number)

    def note(self, event: Event, **details: object) -> None:
        """Write an event into the journal.

        Raises:
            DatasetError: If it cannot be written.
        """
        if self._journal is not None:
            self._journal.note(event, **details)

    def sync(self) -> None:
        """Have all that was appended survive a power cut.

        Raises:
            DatasetError: If the disk fails.
        """
        for shard in self._shards.values():
            shard.sync()

    def digests(self) -> dict[int, str]:
        """Digest of each episode of the shards that are finished, by trial."""
        digests: dict[int, str] = {}
        for shard in self._finished.values():
            pairs = zip(shard.rows["trial"].to_pylist(), shard.rows["digest"].to_pylist(), strict=True)
            digests |= {trial: digest for trial, digest in pairs if digest is not None}
        return digests

    def finish(self, *, wall_s: float | None = None, simulations: int | None = None) -> None:
        """Write everything that describes the dataset as a whole.

        Args:
            wall_s: Real time that the dataset took [s], for the data card; None if not known, or if a journal tells.
            simulations: Number of simulations that took part, for the data card; None if that is not known.

        Raises:
            DatasetError: If trials are missing, or a file cannot be written.
        """
        if self._shards:
            missing = sorted(number for shard in self._shards.values() for number in shard.missing)
            example = f", such as {missing[0]}" if missing else ""
            raise DatasetError(f"lacks {format_count(len(missing), 'trial')}{example}", path=self._directory)
        finished = [self._finished[shard] for shard in sorted(self._finished)]
        throws = pa.concat_tables([each.rows for each in finished])
        if self._journal is not None:
            wall_s = self._journal.measure_collected_s()
        provenance = Provenance.of_this_machine(
            simulations=simulations, wall_s=wall_s, was_open=was_open(self._directory)
        )
        # How it was run may not change the dataset, so what is kept of that stands outside of what the manifest covers.
        config = self._config.without_run()
        write_provenance(self._directory, provenance)
        write_file(self._directory / CARD, data_card(config, throws, provenance).encode())
        write_file(self._directory / CONFIG, dump_yaml(config).encode())
        recordings = [(each.summary, each.entry) for each in finished if each.summary and each.entry]
        write_description(self._directory, config.name, throws, self._channels, recordings)
        self.note("finished", wall_s=wall_s)

    def close(self) -> None:
        """Close all files; what is written stays."""
        for shard in self._shards.values():
            shard.close()
        self._held.close()
        self._journal = None

    def _expect(self, trials: Sequence[Trial]) -> None:
        members: dict[int, list[Trial]] = {}
        for trial in trials:
            members.setdefault(trial.number // self._config.record.trials_per_shard, []).append(trial)
        for number, added in members.items():
            if number not in self._shards:
                path = self._directory / shard_name(self._config.name, number)
                self._shards[number] = OpenShard(path, self._channels)
                self._rows[number] = {}
            self._shards[number].expect(trial.number for trial in added if trial.refused is None)
            for trial in added:
                if trial.refused is not None:
                    self._rows[number][trial.number] = self._table.make_refused_row(trial)
            self._finish_shard_if_complete(number)

    def _row(self, trial: int, result: Result, place: Place | None) -> Row:
        return self._table.row(self.plan.trial(trial), result, place)

    def _waiting_shard(self, trial: int) -> int:
        shard = trial // self._config.record.trials_per_shard
        if shard not in self._shards or trial not in self._shards[shard].missing:
            raise DatasetError(f"no episode of trial {trial} is waited for", path=self._directory)
        return shard

    def _settled(self, number: int) -> bool:
        """Whether no trial will be added to a shard any more."""
        return not self._growing or len(self.plan.trials) >= (number + 1) * self._config.record.trials_per_shard

    def _finish_shard_if_complete(self, number: int) -> None:
        shard = self._shards[number]
        if not shard.missing and self._settled(number):
            self._close_shard(number, shard.finish())

    def _close_shard(self, number: int, finished: FinishedShard) -> None:
        rows = [row for _, row in sorted(self._rows.pop(number).items())]
        for row in rows:
            row["chunk_offset"] = finished.offsets.get(row["trial"])
        self._finished[number] = _Finished(finished.summary, finished.entry, self._table.table(rows))
        shard = self._shards.pop(number)
        if finished.summary is not None:
            self.note("shard", name=shard.path.name)
