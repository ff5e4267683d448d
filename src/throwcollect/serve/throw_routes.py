"""REST on the throws of a collection: all of them for the map, and each one as the page replays it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel

from throwcollect.dataset.directory import JOURNAL, THROWS, path_of_part, shard_of
from throwcollect.dataset.journal import read_commits
from throwcollect.dataset.mcap_reader import EpisodePlace, scan_file
from throwcollect.dataset.throws_table import find_row, judge_episode
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import NotFoundError
from throwcollect.plan.parquet_file import read_parquet
from throwcollect.plan.plan import Plan
from throwcollect.serve.dataset_routes import get_collection, is_finished
from throwcollect.serve.instances import Instances
from throwcollect.serve.throws import describe_trial, encode_throw, read_plan
from throwcollect.tasks.task import task_of

_MOST_THROWS = 20_000
_JOURNAL_BYTES = 4_000_000
"""Most throws with a place, and as many without, and most bytes of a journal (about 15,000 throws), for one answer."""


class ThrowColumns(BaseModel):
    """Throws that have an episode, one column a fact; a trial that was collected again may be there twice.

    Attributes:
        trial: Number of each trial.
        outcome: How it ended.
        x_m: Where it ended [m], in world, with `y_m`; None if it ended nowhere.
        values: Values of each swept key.
        counts: Of a finished dataset, how many throws ended with each outcome.
        total: Number of throws with a place that these were evenly chosen from.
        noun: Word for a throw of this task.
        end: Name of the instant of the place; ``landing`` if the task has none.
        success: Outcome of a throw that succeeded.
        following: What to ask for as `first` next, for throws that come later, if the dataset grows.
        is_finished: Whether the dataset is finished.
        has_more: Whether there are later ones by now.
    """

    trial: list[int]
    outcome: list[str]
    x_m: list[float | None]
    y_m: list[float | None]
    values: dict[str, list[float]]
    counts: dict[str, int] = {}
    total: int
    noun: str
    end: str
    success: str
    following: int = 0
    is_finished: bool = True
    has_more: bool = False


def make_throw_routes(instances: Instances) -> APIRouter:
    """Make the routes on the throws of collections."""
    router = APIRouter(prefix="/collections/{instance}/throws")

    @router.get("")
    def throws(instance: str, first: Annotated[int, Query(ge=0)] = 0) -> ThrowColumns:
        """How throws ended, where, and with which swept values, of a finished dataset or of one that grows."""
        directory, plan = find_plan(instances, instance)
        task = plan.config.task
        end = next(reversed(task.events), "landing")
        names = ("trial", "outcome", f"{end}_x_m", f"{end}_y_m")
        finished = is_finished(directory)
        columns, facts = _read_finished(directory, names) if finished else _read_growing(directory, plan, names, first)
        values = plan.trials.points.values[[trial - plan.trials.first for trial in columns[0]]]
        return ThrowColumns(
            **dict(zip(("trial", "outcome", "x_m", "y_m"), columns, strict=True)),
            **facts,
            values=dict(zip(plan.keys, values.T.tolist(), strict=True)),
            noun=task.noun,
            end=end,
            success=task.success,
        )

    @router.get("/{trial}", response_class=Response)
    def throw(instance: str, trial: int) -> Response:
        """A throw as the page replays it: as a message of the socket `shown`, without the name of a simulation."""
        plan, found = find_throw(instances, instance, trial)
        message = encode_throw(found, "", *describe_trial(plan, trial))
        return Response(message, media_type="application/octet-stream")

    return router


def find_throw(instances: Instances, instance: str, trial: int) -> tuple[Plan, Episode]:
    """Find the plan of a run and the episode of a trial, with what its sensors saw."""
    directory, plan = find_plan(instances, instance)
    episode = _read_finished_episode if is_finished(directory) else _read_growing_episode
    found = episode(directory, plan, trial) if trial in plan.trials.numbers else None
    if found is None:
        why = plan.trials.refused.get(trial, "it has not ended, was lost, or is not planned")
        raise NotFoundError(f"run {instance}: trial {trial} has no episode: {why}")
    return plan, found


def find_plan(instances: Instances, instance: str) -> tuple[Path, Plan]:
    """Directory of the dataset of a run, and its plan."""
    directory = get_collection(instances, instance).record.directory
    try:
        return directory, read_plan(directory)
    except FileNotFoundError:
        raise NotFoundError(f"run {instance} has no dataset: {directory} is not there, or not any more") from None


def _read_finished(directory: Path, names: Sequence[str]) -> tuple[list[Any], dict[str, Any]]:
    """Read the columns of these names from a finished dataset, of as many throws as an answer has, and its counts."""
    # All columns of a million throws would take half a gigabyte.
    table = read_parquet(directory / THROWS, (*names, "digest"))
    recorded = table.filter(table["digest"].is_valid())
    counts = {each["values"]: each["counts"] for each in recorded["outcome"].value_counts().to_pylist()}
    columns = [
        recorded[name].to_pylist() if name in recorded.column_names else [None] * len(recorded) for name in names
    ]
    placed = [row for row, (x, y) in enumerate(zip(*columns[2:], strict=True)) if x is not None and y is not None]
    others = sorted({*range(len(recorded))} - {*placed})
    # The steps are rounded up, so that there are never more throws than allowed.
    some = sorted(row for rows in (placed, others) for row in rows[:: max(1, -(-len(rows) // _MOST_THROWS))])
    return [[column[row] for row in some] for column in columns], {"counts": counts, "total": len(placed)}


def _read_growing(directory: Path, plan: Plan, names: Sequence[str], first: int) -> tuple[list[Any], dict[str, Any]]:
    """Read the columns of these names from a byte of the journal of a dataset that grows, and where that ends."""
    rows, following, more = read_commits(directory / JOURNAL, names, first=first, most_bytes=_JOURNAL_BYTES)
    # A journal may be damaged, or older than the plan.
    kept = [row for row in rows if row[0] in plan.trials.numbers and isinstance(row[1], str)]
    facts = {"total": len(kept), "following": following, "is_finished": False, "has_more": more}
    return [[row[number] for row in kept] for number in range(len(names))], facts


def _read_finished_episode(directory: Path, plan: Plan, trial: int) -> Episode | None:
    """Read an episode at its place in the table of throws, with what the page needs of its result."""
    ends = [f"{end}_{axis}_m" for end in plan.config.task.events for axis in "xyz"]
    columns = ("trial", "outcome", "shard", "chunk_offset", "samples", *ends)
    row = find_row(read_parquet(directory / THROWS, columns), trial)
    if row is None or row["shard"] is None:
        return None
    start_ns = plan.config.trial_start_ns(trial - plan.first_of_part(trial))
    # The table may come from another person, so it does not choose the file.
    place = EpisodePlace(directory / shard_of(plan, trial), row["chunk_offset"], start_ns, row["samples"])
    return replace(place.read(sensors=True), result=json.dumps(row))


def _read_growing_episode(directory: Path, plan: Plan, trial: int) -> Episode | None:
    """Look for an episode in the recording that is being filled, and judge it."""
    shard = directory / shard_of(plan, trial)
    # The unfinished file comes first: when it vanishes in this moment, the final one is there.
    for found in (each for path in (path_of_part(shard), shard) for each in scan_file(path)):
        if found.episode.header.trial == trial:
            config = plan.config_of(plan.trial(trial))
            result = task_of(config).columns.to_json(judge_episode(config, found.episode))
            return replace(found.episode, result=result)
    return None
