"""Makes a sound dataset of a damaged one: every whole episode is kept, and what is lost is said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import reason_not_sweepable
from throwcollect.dataset.directory import CONFIG, PLAN, SHARD_SUFFIX, THROWS, config_path
from throwcollect.dataset.judging import judged
from throwcollect.dataset.new_directory import new_directory
from throwcollect.dataset.rebuild import earlier_rows, reason_lost
from throwcollect.dataset.salvage import Salvaged, salvage
from throwcollect.dataset.throws import REFUSED, Row, ThrowsTable
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_tables import wrong_trials
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.channels import Channels
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError
from throwcollect.robots.description import full_description
from throwcollect.sweep.parquet import read_parquet
from throwcollect.sweep.plan import Plan, make_trials
from throwcollect.sweep.points import Points

Remake = Callable[[Config], Plan]
"""Draws the plan of a configuration."""


@dataclass(frozen=True)
class LostTrial:
    """A trial whose episode is lost.

    Attributes:
        trial: Its number.
        reason: Why.
    """

    trial: int
    reason: str


@dataclass(frozen=True)
class Repaired:
    """What became of a dataset.

    Attributes:
        trials: Number of trials of the plan.
        episodes: Number of episodes that were kept.
        lost: Trials that have no whole episode, and had one or may have had one.
        remarks: What else was not as it should be, a sentence each.
    """

    trials: int
    episodes: int
    lost: tuple[LostTrial, ...]
    remarks: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """The same for JSON."""
        return asdict(self)


def repair(directory: Path, output: Path, *, remake: Remake) -> Repaired:
    """Write a sound dataset with all whole and correct episodes of a damaged one.

    Episodes are looked for in all MCAP files, finished or not, and judged anew. Whatever else there is to a dataset is
    made from the configuration and the plan. Trials without an episode are `lost` in it.

    Args:
        directory: Directory of the damaged dataset; it stays as it is.
        output: Directory of the new one; must not exist, or be empty.
        remake: Draws the plan if neither the one in the directory nor the table of throws can be read.

    Raises:
        ConfigError: If `output` holds something already.
        DatasetError: If neither configuration nor plan can be had, or files cannot be read or written.
    """
    config = _configuration(directory)
    remarks: list[str] = []
    plan = _plan(directory, config, remake, remarks)
    earlier = earlier_rows(directory, plan)
    with new_directory(output) as beside:
        writer = DatasetWriter.create(beside, plan)
        try:
            sorting = _Sorting(plan, writer, remarks)
            for path in sorted(directory.iterdir()):
                if SHARD_SUFFIX in path.suffixes:
                    sorting.take(path)
            lost = sorting.give_up(earlier)
            writer.finish(wall_s=None)
        finally:
            writer.close()
    return Repaired(len(plan.trials), len(sorting.taken), lost, tuple(remarks))


def _configuration(directory: Path) -> Config:
    try:
        return load(config_path(directory))
    except ConfigError as error:
        raise DatasetError(
            f"{directory}: {CONFIG} cannot be read, and nothing else holds the configuration",
            evidence=str(error),
            hint=f"copy the YAML file that the dataset was collected with to {directory / CONFIG}",
        ) from error


def _plan(directory: Path, config: Config, remake: Remake, remarks: list[str]) -> Plan:
    path = directory / PLAN
    try:
        plan = Plan.read(path, config)
        if not (wrong := wrong_trials(plan)):
            return plan
        reason = f"trial {min(wrong)} has another digest than its values and seed"
    except ForeignPlanError as error:
        raise DatasetError(
            f"{error.message} than {CONFIG}; one of the two was changed, and nothing says which",
            hint=f"restore {CONFIG}, or remove {PLAN} if it is the one that is wrong",
        ) from error
    except DatasetError as error:
        reason = str(error).removeprefix(f"{path}: ")
    try:
        plan, source = _plan_of_table(directory / THROWS, config), THROWS
    except DatasetError as error:
        if config.grows:
            raise DatasetError(
                f"{path}: {reason}; it grew with the results, so only {THROWS} could replace it", evidence=str(error)
            ) from error
        try:
            plan, source = remake(config), CONFIG
        except ConfigError as failure:
            raise DatasetError(f"{path}: {reason}; it cannot be drawn again either", evidence=str(failure)) from failure
    remarks.append(f"{PLAN}: {reason}; made again from {source}")
    return plan


def _plan_of_table(path: Path, config: Config) -> Plan:
    """The plan of the trials that a table of throws has.

    Raises:
        DatasetError: If the table is missing or damaged, or not one of this configuration.
    """
    table = read_parquet(path)
    names = table.column_names
    keys = tuple(names[1 : names.index("outcome")]) if "outcome" in names else ()
    rows = table.to_pylist()
    if (
        any(reason_not_sweepable(config, key) for key in keys)
        or not table.schema.equals(ThrowsTable(keys, tuple(config.task.end)).schema)
        or not rows
        or [row["trial"] for row in rows] != list(range(len(rows)))
        or any(row[key] is None for row in rows for key in keys)
    ):
        raise DatasetError(f"{path}: not the table of this configuration, or not of all trials in order")
    points = Points(keys, np.array([[row[key] for key in keys] for row in rows]))
    trials = zip(make_trials(config, points), rows, strict=True)
    return Plan(
        config,
        tuple(replace(trial, refused=row["reason"] if row["outcome"] == REFUSED else None) for trial, row in trials),
    )


@dataclass
class _Sorting:
    """Sorts salvaged episodes into those that are written and those that are not.

    Attributes:
        taken: File and digest of the episode of each trial that was written.
    """

    plan: Plan
    writer: DatasetWriter
    remarks: list[str]
    taken: dict[int, tuple[str, str]] = field(default_factory=dict)
    rejected: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._channels = Channels(self.plan.config, full_description(self.plan.config))
        self._check = EpisodeCheck(self.plan, {})

    def take(self, path: Path) -> None:
        """Write all whole and correct episodes of a file, each trial's first one."""
        try:
            for salvaged in salvage(path):
                self._take(path.name, salvaged)
        except DatasetError as error:
            if not str(error).startswith(f"{path}: "):
                raise
            self.remarks.append(str(error).replace(str(path), path.name, 1))

    def _take(self, name: str, salvaged: Salvaged) -> None:
        episode = salvaged.stored.episode
        trial = episode.header.trial
        place = f"{name}: byte {salvaged.offset}"
        if trial >= len(self.plan.trials) or self.plan.trials[trial].refused is not None:
            self.remarks.append(f"{place}: an episode of trial {trial}, which the plan does not run")
        elif trial in self.taken:
            where, digest = self.taken[trial]
            kind = "the same" if digest == episode.digest else "another"
            self.remarks.append(f"{place}: {kind} episode of trial {trial} was taken from {where} already")
        elif problem := next(self._check.content_problems(episode, self._channels), None):
            self.rejected[trial] = f"{place}: {problem}"
        else:
            self.writer.append(episode, judged(self.plan, episode))
            self.taken[trial] = (name, episode.digest)

    def give_up(self, earlier: Mapping[int, Row]) -> tuple[LostTrial, ...]:
        """Write down the trials that have no episode; returns those that were not lost before."""
        lost = []
        for trial in self.plan.trials:
            if trial.refused is not None or trial.number in self.taken:
                continue
            reason = reason_lost(earlier.get(trial.number))
            if reason is None:
                reason = self.rejected.get(trial.number, "no whole episode of it was left")
                lost.append(LostTrial(trial.number, reason))
            self.writer.append_lost(trial.number, reason)
        return tuple(lost)
