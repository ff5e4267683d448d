"""Finishes a dataset with what is whole of it, without simulating anything."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing, suppress
from pathlib import Path

from throwcollect.config.schema import Config
from throwcollect.coordinator.onlooker import SILENT, Onlooker
from throwcollect.coordinator.resume import resume
from throwcollect.dataset.directory import METADATA, SHARD_SUFFIX, THROWS
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.throws_table import Row, RowsByTrial, ThrowsTable, read_throws_table
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.robots.description import is_available
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.result import LOST, REFUSED, Result

_NO_EPISODE = "no whole episode of it was left"


def finish_without_simulating(
    config: Config, directory: Path, *, sweep_directory: Path, onlooker: Onlooker = SILENT
) -> None:
    """Finish a dataset with the episodes that are whole, and give all other trials up as lost; else as `resume`.

    An episode that the table of throws has keeps its result there, so neither the robot nor an engine is needed. A
    finished dataset of which nothing is missing or damaged stays as it is.
    """
    plan = resume(config, directory, sweep_directory=sweep_directory, onlooker=onlooker)
    if (directory / METADATA).exists():
        onlooker.say(f"{directory}: is finished, and no file of it is missing or damaged")
        return
    table, provenance = ThrowsTable.of(plan), read_provenance(directory)
    rows: Mapping[int, Row] = {}
    with suppress(DatasetError):
        rows = RowsByTrial(read_throws_table(directory / THROWS, plan))

    def judge(config: Config, episode: Episode) -> Result:
        row = rows.get(episode.header.trial)
        return table.result(row) if row and row["digest"] == episode.digest else judge_episode(config, episode)

    there: list[int] = []
    wanted = math.inf if plan.config.until is None else plan.config.until.wanted

    def keep(trial: int, result: Result) -> bool:
        """Note an episode; with `until`, drop those that follow the last trial that is wanted."""
        nonlocal wanted
        if wanted <= 0:
            return False
        there.append(trial)
        wanted -= result.outcome.value == plan.config.task.success
        return True

    with closing(DatasetWriter.open(directory, channels=_read_channels(directory, plan))) as writer:
        writer.recover(keep, judge=judge)
        if plan.config.until is not None:
            # Where the dataset ends without the missing trials is not known, so it ends with the last known one.
            last = max([*there, *([] if wanted <= 0 else rows)], default=plan.trials.first)
            for trial in writer.list_missing():
                if (row := rows.get(trial)) and row["outcome"] == REFUSED:
                    writer.refuse(trial, row["reason"])
            writer.end_with(last)
        for trial in writer.list_missing():
            row = rows.get(trial)
            writer.append_lost(trial, row["reason"] if row and row["outcome"] == LOST else _NO_EPISODE)
        writer.finish(provenance=provenance)


def _read_channels(directory: Path, plan: Plan) -> Channels | None:
    """Read what is recorded where the robot is not installed, from the first recording that describes it; else None."""
    for path in sorted(directory.glob(f"*{SHARD_SUFFIX}*")) if not is_available(plan.config) else ():
        with suppress(DatasetError), open_mcap(path) as contents:
            return Channels(plan.config, contents.read_robot_description())
    return None
