"""Names of the files in the directory of a dataset."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.files import check_regular, suggest_path

if TYPE_CHECKING:
    from throwcollect.plan.plan import Plan

DIRECTORY_VARIABLE = "THROWCOLLECT_DIRECTORY"
"""Directory of the dataset as its user knows it, for processes that see it elsewhere; empty if there is none."""

CONFIG = "config.yaml"
PLAN = "plan.parquet"
THROWS = "throws.parquet"
METADATA = "metadata.yaml"
CARD = "README.md"
PROVENANCE = "provenance.json"
"""How the dataset was collected; the data card shows it."""
TRIALS = "trials.parquet"
"""The points that the sampler `list` of the dataset's own configuration reads."""
ROBOT = "robot"
"""Directory with the files of a robot that a URDF describes."""
SOURCES = "sources.parquet"
"""Where the trials of a derived dataset come from."""
MANIFEST = "datapackage.json"
"""Sizes and hashes of all files that the dataset promises (see `manifest`)."""
SHARD_SUFFIX = ".mcap"
LIBRARY = "throwcollect"
"""What a recording names as the library that wrote it."""
JOURNAL = "logs/journal.jsonl"
ATTEMPT = ".attempt-"
"""Part of the name of the directory of each attempt at a slice, and of no dataset."""

FORMAT = "2"
"""Version of the layout that ``docs/dataset.md`` describes."""


def shard_name(collection: str, number: int) -> str:
    """Make the file name of the shard of a collection that has this number, counted from 0."""
    return f"{collection}_{number:05d}{SHARD_SUFFIX}"


def shard_of(plan: Plan, trial: int) -> str:
    """Name the file that holds the episode of a trial, if it has one; each of joined plans begins with a new file."""
    size, before = plan.config.record.trials_per_shard, 0
    for count in plan.joined:
        if trial < count:
            break
        trial, before = trial - count, before + -(-count // size)
    return shard_name(plan.config.name, before + trial // size)


def list_shards(plan: Plan) -> list[str]:
    """List the names of the files that a plan's trials may have, in order."""
    numbers, size = plan.trials.numbers, plan.config.record.trials_per_shard
    begin = numbers.start // size
    count = sum(-(-part // size) for part in plan.parts)
    return [shard_name(plan.config.name, number) for number in range(begin, begin + count)]


def path_of_part(path: Path) -> Path:
    """Make the path of a shard while it is filled; `path` is its final one."""
    return path.with_name(f"{path.name}.part")


def is_begun(directory: Path) -> bool:
    """Whether a directory holds a dataset that was at least created.

    Bags of others have metadata, exports have tables, and exports and models a ``config.yaml``.
    """
    has_journal = (directory / CONFIG).is_file() and (directory / JOURNAL).is_file()
    return has_journal or (directory / PLAN).exists() or (directory / MANIFEST).exists()


def describe_other(directory: Path) -> str:
    """Describe a directory that holds no dataset."""
    if (directory / METADATA).is_file():
        return "is a rosbag2 bag, but not of throwcollect"
    return f"holds no dataset{suggest_path(directory)}"


def find_known_directory(directory: Path) -> Path | None:
    """Find the directory of a dataset as its user knows it; a process in a container may see it at another path.

    It is None if the user cannot reach the dataset, as in a volume.
    """
    known = os.environ.get(DIRECTORY_VARIABLE, str(directory))
    return Path(known) if known else None


def config_path(directory: Path) -> Path:
    """Make the path of the configuration in a dataset's directory."""
    path = directory / CONFIG
    check_regular(path)
    return path
