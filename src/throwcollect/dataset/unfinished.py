"""Opens a dataset to read it: a finished one as it is, an unfinished one with the trials that have ended."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from throwcollect.arguments import read_path
from throwcollect.dataset.bag import find_next_command
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import METADATA, PLAN, list_shards, path_of_part
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.recovery import find_episodes
from throwcollect.dataset.throws_table import Row, ThrowsTable
from throwcollect.files import StrPath, is_there
from throwcollect.progress_log import log_progress
from throwcollect.sweep.plan import Plan
from throwcollect.wording import format_count


class UnfinishedDatasetWarning(UserWarning):
    """A dataset was opened whose collection has not come to its end."""


def load(directory: StrPath) -> Dataset:
    """Open a dataset for reading.

    Its tables are read and checked against each other; recordings are opened when they are looked at. If the dataset is
    not finished, its recordings are read through, and its rows are the trials that have ended so far: row i need not be
    trial i, and `Dataset.digest` raises an error.

    Raises:
        DatasetError: If the directory holds no dataset, or its tables or plan are damaged.
        ConfigError: If its ``config.yaml`` is wrong.

    Warns:
        UnfinishedDatasetWarning: If it is not finished.
    """
    path = read_path("directory", directory)
    # If the directory is no dataset at all, `open` says what is wrong.
    if is_there(path / METADATA) or not is_there(path / PLAN):
        return Dataset.open(path)
    plan = Plan.read(path / PLAN, read_config(path))
    rows = sorted(_list_rows(path, plan), key=lambda row: int(row["trial"]))
    found = find_next_command(path)
    warnings.warn(
        f"{path} {found.state}: it has {len(rows)} of {format_count(len(plan.trials), 'trial')} so far; "
        f"`{found.command}` {found.purpose}",
        UnfinishedDatasetWarning,
        stacklevel=2,
    )
    return Dataset(path, plan, ThrowsTable.of(plan).table(rows), {})


def _list_rows(directory: Path, plan: Plan) -> Iterator[Row]:
    """Make the rows of the refused trials, and of those whose episodes are on disk as `resume` would keep them."""
    table = ThrowsTable.of(plan)
    yield from (table.make_refused_row(plan.trial(number)) for number in plan.trials.refused)
    names = list_shards(plan)
    for name in log_progress(names, len(names), "recording", "looked through"):
        final = directory / name
        # The unfinished file comes first: when it vanishes in this moment, the final one is there.
        episodes = find_episodes(path_of_part(final), plan) | find_episodes(final, plan)
        # An episode whose records are damaged can be saved, and not read in place.
        for found in (each for each in episodes.values() if each.run is not None):
            yield table.row(plan.trial(found.trial), found.result, found.place)
