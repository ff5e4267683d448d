"""Writes again those files of a dataset that follow from others: table of throws, manifest, metadata and data card."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary, refuse_other_directory
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.data_card import data_card, outcome_lines, read_card
from throwcollect.dataset.directory import CARD, CONFIG, MANIFEST, PLAN, THROWS, list_shards, shard_of
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.journal import was_open
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.manifest import entry_of_file, was_changed
from throwcollect.dataset.mcap_reader import StoredEpisode
from throwcollect.dataset.provenance import Provenance, read_provenance, write_provenance
from throwcollect.dataset.recovery import remove_unfinished
from throwcollect.dataset.summary_files import WRITTEN, write_description
from throwcollect.dataset.throws_table import Row, RowsByTrial, ThrowsTable, read_throws_table
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_shard import check_shard
from throwcollect.dataset.verify_tables import find_wrong_trials
from throwcollect.episode.channels import Channels
from throwcollect.errors import DatasetError, ForeignPlanError
from throwcollect.files import write_file
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import full_description
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.result import LOST
from throwcollect.tasks.task import Task, task_of
from throwcollect.wording import command

NO_EPISODE = "no file holds an episode of it"
"""Reason of a lost trial if no earlier table gives another one."""


@dataclass(frozen=True)
class Rejudged:
    """A trial that is judged differently than in the earlier table of throws: its outcomes `before` and `after`."""

    trial: int
    before: str
    after: str


@dataclass(frozen=True)
class Rebuilt:
    """The result of a rebuild: how many trials and episodes there are, and the names of the files that were written.

    Attributes:
        lost: Trials that should have an episode and have none.
        rejudged: Trials whose outcome has changed.
    """

    trials: int
    episodes: int
    lost: tuple[int, ...]
    rejudged: tuple[Rejudged, ...]
    written: tuple[str, ...]


def rebuild(directory: Path) -> Rebuilt:
    """Write ``throws.parquet``, the manifest and ``metadata.yaml`` anew, and the data card if it is missing.

    They follow from the configuration, the plan and the recordings, which are checked as `verify` does. The earlier
    table, if it can be read, says why trials are lost and which recordings there should be. Where the recordings are
    judged differently than it says, the data card gets the new numbers of outcomes.
    """
    refuse_other_directory(directory)
    with hold_lock(directory):
        return _rebuild(directory)


def _read_config(directory: Path) -> Config:
    """Read the configuration, and refuse one that is not as the manifest says."""
    config = read_config(directory)
    # A line that equals its default can be lost without a change of the plan's digest. A new manifest would then hide
    # that the file is not the one that the same collection gives.
    if was_changed(directory, CONFIG):
        raise DatasetError(
            f"is not as it was written: {MANIFEST} has another hash of it",
            path=directory / CONFIG,
            hint=f"{command('resume', directory)} puts back lines that equal their defaults",
        )
    return config


def _read_plan(directory: Path, config: Config, repair: str) -> Plan:
    """Read the plan."""
    try:
        return Plan.read(directory / PLAN, config)
    except ForeignPlanError:
        raise
    except DatasetError as error:
        error.hint = error.hint or repair
        raise


def _rebuild(directory: Path) -> Rebuilt:
    config = _read_config(directory)
    repair = command("dataset", "repair", directory, "OUTPUT")
    plan = _read_plan(directory, config, repair)
    # This comes before the search for `*.part`, a name that earlier versions gave to unfinished plans, which may go.
    remove_unfinished(directory)
    if unfinished := sorted(path.name for path in directory.glob("*.part")):
        raise DatasetError(
            f"holds {unfinished[0]}: it is not collected to its end",
            path=directory,
            hint=f"{command('resume', directory)}, or {repair}",
        )
    # The recordings are checked against the plan, so a changed plan would make sound recordings look damaged.
    if wrong := find_wrong_trials(plan):
        raise DatasetError(
            "was changed since the plan was made", path=directory / PLAN, place=f"trial {min(wrong)}", hint=repair
        )
    earlier, recordings = read_earlier_rows(directory, plan), _Recordings(plan)
    throws = pa.concat_tables(_tabulate(directory, plan, recordings, earlier, repair)).combine_chunks()
    outcomes = list(zip(throws["trial"].to_pylist(), throws["outcome"].to_pylist(), strict=True))
    channels = recordings.channels or Channels(config, full_description(config))
    written = [*WRITTEN]
    if not (directory / CARD).exists():
        provenance = read_provenance(directory)
        # Earlier versions wrote none, so this machine stands in for the unknown one that collected the dataset.
        if provenance is None:
            provenance = Provenance.of_this_machine(
                simulations=None, wall_s=None, was_open=was_open(directory), robot=channels.robot
            )
            write_provenance(directory, provenance)
        write_file(directory / CARD, data_card(config.without_run(), throws, provenance).encode())
        written.append(CARD)
    rejudged = tuple(
        Rejudged(trial, before["outcome"], outcome)
        for trial, outcome in outcomes
        if (before := earlier.get(trial)) and before["outcome"] != outcome
    )
    # People may have edited the card, so only its numbers are corrected.
    if rejudged and CARD not in written:
        before = pa.table({"outcome": [row["outcome"] for row in earlier.values()]})
        _correct_card(directory / CARD, before, throws)
        written.append(CARD)
    files = [(summary, entry_of_file(directory / summary.path)) for summary in recordings.summaries]
    write_description(directory, config.name, throws, channels, files)
    lost = tuple(trial for trial, outcome in outcomes if outcome == LOST)
    episodes = len(throws) - throws["digest"].null_count
    return Rebuilt(len(throws), episodes, lost, rejudged, tuple(written))


def _tabulate(
    directory: Path, plan: Plan, recordings: _Recordings, earlier: Mapping[int, Row], repair: str
) -> Iterator[pa.Table]:
    """Read the recordings one after the other, and make the table of the trials of each.

    No more than the rows of one recording are held at once, as rows take ten times the memory of a table.
    """
    table, task = ThrowsTable.of(plan), task_of(plan.config)
    named = {row["shard"] for row in earlier.values()}
    shards = groupby(plan.trials, lambda trial: shard_of(plan, trial.number))
    for name, trials in log_progress(shards, len(list_shards(plan)), "recording", "looked through"):
        recordings.rows.clear()
        if (directory / name).exists():
            # A new table and a new manifest would make the damage look as if it had been collected.
            if findings := recordings.read(directory / name):
                raise DatasetError(str(findings[0]), path=directory, hint=repair)
        # A file that no row names may be missing: all of its trials were refused, or lost.
        elif name in named:
            raise DatasetError(f"{name} is missing", path=directory, hint=repair)
        yield table.table(
            recordings.rows.get(trial.number)
            or _make_row_without_episode(table, task, trial, earlier.get(trial.number))
            for trial in trials
        )


def _correct_card(path: Path, before: pa.Table, after: pa.Table) -> None:
    """Put the numbers of outcomes into a data card; people may have written the rest, so it stays."""
    card = read_card(path)
    lines, instead = ("\n".join(outcome_lines(table)) for table in (before, after))
    write_file(path, card.replace(lines, instead, 1).encode())


def read_earlier_rows(directory: Path, plan: Plan) -> Mapping[int, Row]:
    """Read the rows of the table of throws that a dataset has, by trial; none if it cannot be read."""
    with suppress(DatasetError):
        return RowsByTrial(read_throws_table(directory / THROWS, plan))
    return {}


def _make_row_without_episode(table: ThrowsTable, task: Task[Any], trial: Trial, earlier: Row | None) -> Row:
    """Make the row of a trial that has no episode; one that was lost before keeps its reason."""
    if trial.refused is not None:
        return table.make_refused_row(trial)
    return table.row(trial, task.lose(reason_lost(earlier) or NO_EPISODE), None)


def reason_lost(earlier: Row | None) -> str | None:
    """Find the reason why a trial was lost according to an earlier row; None if the row does not say that it was."""
    if earlier is None or earlier["outcome"] != LOST:
        return None
    return str(earlier["reason"] or NO_EPISODE)


class _Recordings:
    """The contents of the MCAP files of a dataset, which are read one after the other.

    Attributes:
        rows: Rows of the episodes that were read since it was last cleared, by trial.
        summaries: What the bag's metadata say of each file.
        channels: What is recorded; None if there is no file.
    """

    def __init__(self, plan: Plan) -> None:
        self.rows: dict[int, Row] = {}
        self.summaries: list[FileSummary] = []
        self.channels: Channels | None = None
        self._plan = plan
        self._check = EpisodeCheck(plan, {})

    def read(self, path: Path) -> list[Finding]:
        """Read a file and return its findings; only a file without findings counts."""
        checked = check_shard(path, self._plan.config, None, self._find_problems)
        if not checked.findings and checked.summary is not None:
            self.summaries.append(checked.summary)
            self.channels = checked.channels
        return checked.findings

    def _find_problems(self, stored: StoredEpisode, shard: str, channels: Channels | None) -> Iterator[str]:
        problems = list(self._check.find_problems(stored, shard, channels))
        yield from problems
        if not problems:
            trial = self._plan.trial(stored.episode.header.trial)
            if trial.refused is not None or shard != shard_of(self._plan, trial.number):
                yield "its episode does not belong in this file"
            self.rows[trial.number] = self._check.row(stored, shard)
