"""Makes a sound dataset of a damaged one: keeps every whole episode, and reports the lost ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.target_columns import is_target
from throwcollect.config.values import keys_by_column, reason_not_sweepable
from throwcollect.dataset.bag import refuse_other_directory
from throwcollect.dataset.configuration import unfitting_plan
from throwcollect.dataset.creation import create
from throwcollect.dataset.directory import CONFIG, PLAN, SHARD_SUFFIX, THROWS, TRIALS, config_path
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.misses import read_targets
from throwcollect.dataset.rebuild import read_earlier_rows, reason_lost
from throwcollect.dataset.scan import FoundEpisode, scan_whole
from throwcollect.dataset.throws_table import Row, ThrowsTable
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_tables import find_wrong_trials, read_list
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError
from throwcollect.files import new_directory
from throwcollect.robots.description import full_description
from throwcollect.sweep.parquet_file import read_parquet
from throwcollect.sweep.plan import Plan, make_trials
from throwcollect.sweep.points import Points
from throwcollect.tasks.result import REFUSED

Remake = Callable[[Config], Plan]
"""Draws the plan of a configuration."""


@dataclass(frozen=True)
class LostTrial:
    """A trial whose episode is lost, and the reason."""

    trial: int
    reason: str


@dataclass(frozen=True)
class DifferingEpisode:
    """An episode that was kept, as no file holds the one whose digest the table of throws has (`expected`)."""

    trial: int
    file: str
    digest: str
    expected: str


@dataclass(frozen=True)
class Repaired:
    """The result of a repair: how many trials there are, and how many of their episodes were kept.

    Attributes:
        lost: Trials that have no whole episode, and had one or may have had one.
        differing: Episodes that were kept although the table of throws has others.
        remarks: Everything else that was wrong, a sentence each.
    """

    trials: int
    episodes: int
    lost: tuple[LostTrial, ...]
    differing: tuple[DifferingEpisode, ...]
    remarks: tuple[str, ...]


def repair(directory: Path, output: Path, *, remake: Remake) -> Repaired:
    """Write a sound dataset with all whole and correct episodes of a damaged one.

    Episodes are looked for in all MCAP files, finished or not, and judged anew. Where the table of throws can be read,
    its digest says which episode of a trial is the right one. If no file has that one, another one that passes all
    other checks is kept and reported: only a replay can tell whether the episode or the table was changed. All other
    files are made from the configuration and the plan. Trials without an episode are `lost` in them.

    Args:
        directory: Directory of the damaged dataset; it stays as it is.
        output: Directory of the new one; must be new or empty.
        remake: Draws the plan if neither the one in the directory nor the table of throws can be read.
    """
    refuse_other_directory(directory)
    # The lock is refused while the dataset is being collected: trials that have not run yet would be taken for lost.
    with hold_lock(directory, needed=False), new_directory(output) as beside:
        config = _read_configuration(directory)
        remarks: list[str] = []
        plan = _read_or_remake_plan(directory, config, remake, remarks)
        earlier = read_earlier_rows(directory, plan)
        create(beside, plan, listed=_find_list(directory, plan, remarks))
        with closing(DatasetWriter(beside, plan)) as writer:
            digests = {trial: row["digest"] for trial, row in earlier.items() if row["digest"] is not None}
            sorting = _Sorting(plan, writer, digests, remarks)
            for path in sorted(directory.iterdir()):
                if SHARD_SUFFIX in path.suffixes:
                    sorting.take(path)
            sorting.settle(directory)
            lost = sorting.give_up(earlier)
            writer.finish()
    return Repaired(len(plan.trials), len(sorting.taken), lost, tuple(sorting.differing), tuple(remarks))


def _read_configuration(directory: Path) -> Config:
    try:
        return load(config_path(directory))
    except (ConfigError, DatasetError) as error:
        raise DatasetError(
            f"{CONFIG} cannot be read, and nothing else holds the configuration",
            path=directory,
            evidence=str(error),
            hint=f"copy the YAML file that the dataset was collected with to {directory / CONFIG}",
        ) from error


def _read_or_remake_plan(directory: Path, config: Config, remake: Remake, remarks: list[str]) -> Plan:
    path = directory / PLAN
    try:
        plan = Plan.read(path, config)
        if not (wrong := find_wrong_trials(plan)):
            return plan
        reason = f"trial {min(wrong)} has another digest than its values and seed"
    except ForeignPlanError as error:
        raise unfitting_plan(error) from error
    except DatasetError as error:
        reason = error.details
    try:
        plan, source = _make_plan_of_table(directory / THROWS, config), THROWS
    except DatasetError as error:
        if config.grows:
            raise DatasetError(
                f"{reason}; it grew with the results, so only {THROWS} could replace it", path=path, evidence=str(error)
            ) from error
        try:
            plan, source = remake(config), CONFIG
        except ConfigError as failure:
            raise DatasetError(
                f"{reason}; it cannot be drawn again either", path=path, evidence=str(failure)
            ) from failure
    remarks.append(f"{PLAN}: {reason}; made again from {source}")
    return plan


def _make_plan_of_table(path: Path, config: Config) -> Plan:
    """Make the plan of the trials that a table of throws has."""
    table = read_parquet(path)
    names = table.column_names
    # Between number and outcome are the columns that were drawn: swept keys, then targets.
    drawn = names[1 : names.index("outcome")] if "outcome" in names else []
    columns = keys_by_column(config, (name for name in drawn if not is_target(name)))
    keys = tuple(columns.values())
    targets = tuple(name for name in drawn if is_target(name))
    rows = table.to_pylist()
    if (
        any(reason_not_sweepable(config, key) for key in keys)
        or config.task.find_wrong_targets(targets)
        or not table.schema.equals(ThrowsTable(keys, config, targets).schema)
        or not rows
        or [row["trial"] for row in rows] != list(range(len(rows)))
        or any(row[name] is None for row in rows for name in columns)
    ):
        raise DatasetError("not the table of this configuration, or not of all trials in order", path=path)
    points = Points(keys, np.array([[row[name] for name in columns] for row in rows]), read_targets(table))
    reasons = [row["reason"] if row["outcome"] == REFUSED else None for row in rows]
    return Plan(config, make_trials(config, points).refuse(reasons))


def _find_list(directory: Path, plan: Plan, remarks: list[str]) -> Points | None:
    """Read the list of points that the configuration names, or make it from the plan; None if it names none."""
    if plan.config.sweep.file is None:
        return None
    try:
        return read_list(directory, plan)
    except DatasetError as error:
        remarks.append(f"{TRIALS}: {error.details}; made again from {PLAN}")
        return plan.trials.points


@dataclass
class _Sorting:
    """Decides which of the whole episodes are written.

    Attributes:
        plan: The trials.
        writer: Writes the new dataset.
        digests: Digests of the right episodes, by trial, as far as the table of throws has them.
        remarks: Receives a sentence for everything that is wrong.
        taken: File and digest of the episode of each trial that was written.
        differing: Episodes that were written and have another digest than the right one.
        waiting: Episodes that have another digest than the right one, by trial, in the order in which they were found.
        rejected: Why the last episode of a trial that a check refused was not written, by trial.
    """

    plan: Plan
    writer: DatasetWriter
    digests: Mapping[int, str]
    remarks: list[str]
    taken: dict[int, tuple[str, str]] = field(default_factory=dict)
    differing: list[DifferingEpisode] = field(default_factory=list)
    waiting: dict[int, list[DifferingEpisode]] = field(default_factory=dict)
    rejected: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._channels = Channels(self.plan.config, full_description(self.plan.config))
        self._check = EpisodeCheck(self.plan, {})

    def take(self, path: Path) -> None:
        """Write the right episodes of a file, the first one of each trial; those that differ from the table wait."""
        try:
            for found in scan_whole(path):
                self._take(path.name, found)
        except DatasetError as error:
            # An error of the new dataset, such as a full disk, is no damage of this file.
            if error.path != path:
                raise
            self.remarks.append(str(error.locate(Path(path.name))))

    def _take(self, name: str, found: FoundEpisode) -> None:
        episode = found.stored.episode
        trial = episode.header.trial
        place = f"{name}: byte {found.stored.offset}"
        if trial >= len(self.plan.trials) or self.plan.trial(trial).refused is not None:
            self.remarks.append(f"{place}: an episode of trial {trial}, which the plan does not run")
        elif trial in self.taken:
            where, digest = self.taken[trial]
            kind = "the same" if digest == episode.digest else "another"
            self.remarks.append(f"{place}: {kind} episode of trial {trial} was taken from {where} already")
        elif problem := next(self._check.find_content_problems(episode, self._channels), None):
            self.rejected[trial] = f"{place}: {problem}"
        elif (right := self.digests.get(trial, episode.digest)) != episode.digest:
            differing = DifferingEpisode(trial, name, digest=episode.digest, expected=right)
            self.waiting.setdefault(trial, []).append(differing)
        else:
            self._write(name, episode)

    def settle(self, directory: Path) -> None:
        """Write the first waiting episode of each trial whose right one was not found, and remark on all of them."""
        reading: dict[Path, Iterator[FoundEpisode]] = {}
        for trial, candidates in sorted(self.waiting.items()):
            for episode in candidates:
                difference = f"an episode with digest {episode.digest}, not {episode.expected} as in {THROWS}"
                remark = f"{episode.file}: trial {trial}: {difference}"
                if trial in self.taken:
                    file, digest = self.taken[trial]
                    kind = "right" if digest == episode.expected else "first"
                    self.remarks.append(f"{remark}; the {kind} one was taken from {file}")
                else:
                    self._write(episode.file, _find_again(directory / episode.file, episode, reading))
                    self.differing.append(episode)
                    self.remarks.append(f"{remark}; kept, as it passes all other checks")

    def _write(self, name: str, episode: Episode) -> None:
        self.writer.append(episode, self._check.judge(episode))
        self.taken[episode.header.trial] = (name, episode.digest)

    def give_up(self, earlier: Mapping[int, Row]) -> tuple[LostTrial, ...]:
        """Write that the other trials have no episode; return those that were not lost before."""
        lost = []
        for trial in self.plan.trials:
            if trial.refused is not None or trial.number in self.taken:
                continue
            reason = reason_lost(earlier.get(trial.number))
            # A trial that the collection itself had lost keeps its reason, and is not reported as lost by the damage.
            if reason is None:
                reason = self.rejected.get(trial.number, "no whole episode of it was left")
                lost.append(LostTrial(trial.number, reason))
            self.writer.append_lost(trial.number, reason)
        return tuple(lost)


def _find_again(path: Path, wanted: DifferingEpisode, reading: dict[Path, Iterator[FoundEpisode]]) -> Episode:
    """Read a waiting episode from its file once more, as only one episode at a time is kept in memory.

    Args:
        path: The file.
        wanted: The episode.
        reading: The file that was read last, and the episodes that follow there, as most files are in order of trials.
    """
    for episodes in (reading.get(path, iter(())), scan_whole(path)):
        reading.clear()
        for found in episodes:
            episode = found.stored.episode
            if (episode.header.trial, episode.digest) == (wanted.trial, wanted.digest):
                reading[path] = episodes
                return episode
    raise DatasetError("was changed while it was read", path=path)
