"""Fills a dataset: from a frozen plan and episodes in any order to files that depend on nothing but the plan.

A directory that holds ``config.yaml`` and ``plan.parquet`` is a created dataset; one that also holds ``metadata.yaml``
is finished, as that file is written last. While a dataset is filled, each open shard lies next to its final name (see
`shard`), and the rows of finished shards are kept in memory, 0.5 kB each, for ``throws.parquet``. If the process is
stopped, the next writer takes in the files that it left (see `recovery`) and goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.dataset.carried_robot import write_config
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.data_card import data_card
from throwcollect.dataset.directory import CARD, CONFIG, MANIFEST, METADATA, PLAN, path_of_part, shard_name
from throwcollect.dataset.journal import Event, Journal, was_open
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.provenance import Provenance, write_provenance
from throwcollect.dataset.recovery import LeftOfShard, find_left, recover_shard, remove_unfinished
from throwcollect.dataset.shard import FinishedShard, OpenShard, Recording
from throwcollect.dataset.summary_files import write_description
from throwcollect.dataset.throws_table import Row, ThrowsTable, count_outcomes, place_columns
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.files import remove, write_file
from throwcollect.plan.plan import Plan
from throwcollect.robots.description import full_description
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of
from throwcollect.wording import format_count

Keep = Callable[[int, Result], bool]
"""A callback: gets the number of a trial and the result of its episode, and returns whether the episode is kept."""


class DatasetWriter:
    """Takes the episodes of a plan's trials, each once and in any order, and writes the dataset.

    Args:
        directory: A directory as `create` leaves it.
        plan: The plan in that directory.
        journal: Receives events; None for datasets that are written in one go.
        channels: What is recorded; None for the channels of the robot that is installed here.

    Attributes:
        plan: The trials.
    """

    def __init__(
        self,
        directory: Path,
        plan: Plan,
        *,
        journal: Journal | None = None,
        channels: Channels | None = None,
    ) -> None:
        self._directory = directory
        self._config: Config = plan.config
        self._journal = journal
        self.plan, self._trials_per_shard = plan, plan.config.record.trials_per_shard
        self._channels = channels or Channels(self._config, full_description(self._config))
        self._table = ThrowsTable.of(plan)
        trials = plan.trials.numbers
        self._unfinished = {*range(self._number_of(trials.start), self._number_of(trials.stop - 1) + 1)}
        self._shards: dict[int, OpenShard] = {}
        """Unfinished shards with at least one trial that has ended."""
        self._recordings: dict[int, Recording] = {}
        """The file of each finished shard that has one."""
        self._finished_rows: dict[int, pa.Table] = {}
        """The rows of each finished shard, in order of trials."""
        self._held = ExitStack()
        for number in sorted(self._unfinished):
            # A shard of refused trials alone waits for no episode, and nothing would finish it later.
            if next(self._list_to_run(number), None) is None:
                self._finish_shard_if_complete(number)

    @classmethod
    def open(cls, directory: Path, *, channels: Channels | None = None) -> DatasetWriter:
        """Open a dataset to collect into, and keep all other processes from doing so; call `recover` next."""
        for name in (CONFIG, PLAN):
            if not (directory / name).is_file():
                raise DatasetError(f"holds no {name}", path=directory, expected="a dataset that was created")
        with ExitStack() as held:
            # Plan and configuration are read after this, when no other process can change them any more.
            held.enter_context(hold_lock(directory, alone=False))
            journal = held.enter_context(closing(Journal(directory)))
            plan = Plan.read(directory / PLAN, read_config(directory))
            writer = cls(directory, plan, journal=journal, channels=channels)
            writer._held = held.pop_all()
        return writer

    def recover(self, keep: Keep = lambda *_: True, *, processes: int = 1) -> int:
        """Take in what earlier writers have left: every episode that is whole stays, everything else is removed.

        A finished dataset then counts as unfinished, even if all its trials have ended; `finish` writes the same files.

        Args:
            keep: Called for each trial that has an episode, in order of trials; what it does not keep is removed.
            processes: How many processes may look through the recordings of a large dataset, as for `find_left`.

        Returns:
            Number of episodes.
        """
        remove_unfinished(self._directory)
        # metadata.yaml marks a finished dataset. The table stays until `finish` replaces it, as it has results.
        for name in (METADATA, MANIFEST):
            remove(self._directory / name)
        count = 0
        # Every process gets the trials of the shards that it looks through, and not a whole plan.
        paths = {each: self._directory / shard_name(self._config.name, each) for each in sorted(self._unfinished)}
        begun = {number: path for number, path in paths.items() if path.exists() or path_of_part(path).exists()}
        first = self.plan.trials.first
        parts = [
            (path, Plan(self._config, self.plan.trials[members.start - first : members.stop - first]))
            for path, members in zip(begun.values(), map(self._list_members, begun), strict=True)
        ]
        all_left = find_left(parts, self._channels, processes=processes)
        for number, found in zip(begun, all_left, strict=True):
            kept = {trial: each for trial, each in sorted(found.episodes.items()) if keep(trial, each.result)}
            left = found if len(kept) == len(found.episodes) else LeftOfShard(found.path, kept, None)
            shard = self._get_shard(number)
            recover_shard(shard, left)
            for trial, each in left.episodes.items():
                place = {**each.place, "shard": shard.path.name}
                shard.rows[trial] = self._table.row(self.plan.trial(trial), each.result, place)
            count += len(left.episodes)
            if left.finished is not None:
                self._close_shard(number, left.finished)
            elif left.episodes or not shard.missing:
                self._finish_shard_if_complete(number)
            else:
                del self._shards[number]
        if count:
            self.note("recovered", episodes=count)
        return count

    def refuse(self, trial: int, reason: str) -> None:
        """Note that a trial, which has no episode, is not run after all."""
        self.plan.trials.refused[trial] = reason
        number = self._number_of(trial)
        self._get_shard(number).missing.discard(trial)
        self._finish_shard_if_complete(number)

    def end_with(self, last: int) -> None:
        """End the dataset with a trial of the plan, and write the plan without the trials that follow.

        All trials up to the last one have to be in, and no later one may be.
        """
        self.plan = replace(self.plan, trials=self.plan.trials[: last + 1 - self.plan.trials.first])
        self.plan.write(self._directory / PLAN)
        self._unfinished = {number for number in self._unfinished if number <= self._number_of(last)}
        for number in list(self._unfinished):
            self._get_shard(number).missing.intersection_update(self._list_members(number))
            self._finish_shard_if_complete(number)

    def take_shard(self, number: int, recording: Recording | None, rows: pa.Table) -> None:
        """Take in a finished shard with the rows of its trials; its file, if it has one, already has its final name."""
        self._unfinished.discard(number)
        self._finished_rows[number] = rows
        if recording is not None:
            self._recordings[number] = recording

    def append(self, episode: Episode, result: Row) -> None:
        """Write an episode, whose trial ended with a result of these columns (`ResultColumns.write`)."""
        trial = episode.header.trial
        number = self._find_waiting_shard(trial)
        shard = self._get_shard(number)
        shard.append(episode)
        # The offset is not known before the shard is written in order of trials; `_close_shard` puts it in.
        place = place_columns(shard.path.name, -1, episode)
        row = shard.rows[trial] = self._table.join(self.plan.trial(trial), result, place)
        ends = {name: row[name] for name in self._config.task.targets if row.get(name) is not None}
        self.note("commit", trial=trial, outcome=row["outcome"], digest=episode.digest, **ends)
        self._finish_shard_if_complete(number)

    def append_lost(self, trial: int, reason: str) -> None:
        """Write that a trial has no episode, and the reason for it."""
        number = self._find_waiting_shard(trial)
        shard = self._get_shard(number)
        shard.missing.remove(trial)
        shard.rows[trial] = self._table.row(self.plan.trial(trial), task_of(self._config).lose(reason), None)
        self.note("lost", trial=trial, reason=reason)
        self._finish_shard_if_complete(number)

    def list_missing(self) -> list[int]:
        """List the trials that have not ended, in order."""
        return [trial for number in sorted(self._unfinished) for trial in sorted(self._get_shard(number).missing)]

    def note(self, event: Event, **details: object) -> None:
        """Write an event into the journal."""
        if self._journal is not None:
            self._journal.note(event, **details)

    def sync(self) -> None:
        """Make everything that was appended survive a power cut."""
        for shard in self._shards.values():
            shard.sync()

    def throws(self) -> pa.Table:
        """Join the rows of all trials, in their order; all shards must be finished."""
        return pa.concat_tables(rows for _, rows in sorted(self._finished_rows.items()))

    def finish(self, *, simulations: int | None = None, provenance: Provenance | None = None) -> dict[str, int]:
        """Write the files that describe the dataset as a whole.

        Args:
            simulations: Number of simulations that took part, for the data card; None if that is not known.
            provenance: How the dataset was collected; None if this process has collected it.

        Returns:
            Number of trials of each outcome.
        """
        if self._unfinished:
            missing = self.list_missing()
            example = f", such as {missing[0]}" if missing else ""
            raise DatasetError(f"lacks {format_count(len(missing), 'trial')}{example}", path=self._directory)
        throws = self.throws()
        wall_s = self._journal.measure_collected_s() if self._journal is not None else None
        provenance = provenance or Provenance.of_this_machine(
            simulations=simulations,
            wall_s=wall_s,
            was_open=was_open(self._directory),
            robot=self._channels.robot,
            engine=self._config.sim.engine,
        )
        # How it was run must not change the dataset, so only data card and provenance have that.
        config = self._config.without_run()
        write_file(self._directory / CARD, data_card(config, throws, provenance).encode())
        write_provenance(self._directory, provenance)
        write_config(self._directory, config)
        recordings = [self._recordings[number] for number in sorted(self._recordings)]
        write_description(self._directory, config.name, throws, self._channels, recordings)
        self.note("finished", wall_s=wall_s)
        return count_outcomes(throws)

    def close(self) -> None:
        """Close all files; written data stay."""
        for shard in self._shards.values():
            shard.close()
        self._held.close()
        self._journal = None

    def _number_of(self, trial: int) -> int:
        """Find the number of the shard of a trial."""
        return trial // self._trials_per_shard

    def _list_members(self, number: int) -> range:
        """List the trials of a shard."""
        size, numbers = self._trials_per_shard, self.plan.trials.numbers
        return range(max(number * size, numbers.start), min((number + 1) * size, numbers.stop))

    def _list_to_run(self, number: int) -> Iterator[int]:
        """List the trials of a shard that are not refused."""
        return (each for each in self._list_members(number) if each not in self.plan.trials.refused)

    def _get_shard(self, number: int) -> OpenShard:
        """Return an unfinished shard, which takes memory only once it has been asked for."""
        if number not in self._shards:
            self._shards[number] = OpenShard(self._directory / shard_name(self._config.name, number), self._channels)
            self._shards[number].missing.update(self._list_to_run(number))
        return self._shards[number]

    def _find_waiting_shard(self, trial: int) -> int:
        shard = self._number_of(trial)
        if shard not in self._unfinished or trial not in self._get_shard(shard).missing:
            raise DatasetError(f"no episode of trial {trial} is waited for", path=self._directory)
        return shard

    def _finish_shard_if_complete(self, number: int) -> None:
        shard = self._get_shard(number)
        if not shard.missing:
            self._close_shard(number, shard.finish())

    def _close_shard(self, number: int, finished: FinishedShard) -> None:
        shard, refused = self._shards.pop(number), self._table.make_refused_row
        rows = [shard.rows.get(trial) or refused(self.plan.trial(trial)) for trial in self._list_members(number)]
        for row in rows:
            row["chunk_offset"] = finished.offsets.get(row["trial"])
        self.take_shard(number, finished.recording, self._table.table(rows))
        if finished.recording is not None:
            self.note("shard", name=shard.path.name)
