"""Summaries of datasets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.config.task_config import TaskConfig
from throwcollect.dataset.journal import measure_collected_s
from throwcollect.dataset.misses import summarise_misses
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import Info
from throwcollect.dataset.throws_table import count_outcomes
from throwcollect.errors import DatasetError
from throwcollect.plan.arrow_column import nan_where_null


def info(directory: Path) -> Info:
    """Summarise a dataset from its tables; `verify` checks whether they are right."""
    return summary(Dataset.open(directory))


def summary(dataset: Dataset) -> Info:
    """Summarise an open dataset."""
    directory = dataset.directory
    shards, topics = dataset.shards, dataset.topics
    try:
        sizes = {path.name: path.stat().st_size for path in directory.iterdir() if path.is_file()}
    except OSError as error:
        raise DatasetError(f"cannot be read: {error.strerror}", path=directory) from error
    episodes = len(dataset.throws) - dataset.throws["shard"].null_count
    samples = sum(count for count in dataset.throws["samples"].to_pylist() if count is not None)
    return Info(
        name=dataset.config.name,
        trials=len(dataset.throws),
        episodes=episodes,
        outcomes=count_outcomes(dataset.throws),
        wanted=dataset.config.until.wanted if dataset.config.until else None,
        landing=_find_landing_area(dataset.throws, dataset.config.task),
        end=next(iter(dataset.config.task.events[-1:]), ""),
        samples=samples,
        # An episode of n samples lasts n - 1 intervals.
        duration_s=(samples - episodes) / dataset.config.record.rate_hz,
        shards=len(shards),
        size_bytes=sum(sizes.values()),
        recordings_bytes=sum(size for name, size in sizes.items() if name.endswith(".mcap")),
        topics=topics,
        digest=dataset.digest,
        wall_s=measure_collected_s(directory),
        success=dataset.config.task.success,
        noun=dataset.config.task.noun,
        misses=summarise_misses(dataset.config, dataset.throws),
    )


def _find_landing_area(throws: pa.Table, task: TaskConfig) -> Mapping[str, tuple[float, float]] | None:
    """Find where trials that succeeded ended; a ball that hit the robot first may cross the landing plane, too."""
    if not task.events:
        return None
    rows = np.array([outcome == task.success for outcome in throws["outcome"].to_pylist()], np.bool_)
    found = {}
    for axis in ("x_m", "y_m"):
        ends = nan_where_null(throws[f"{task.events[-1]}_{axis}"].combine_chunks())[rows]
        if np.isnan(ends).all():
            return None
        found[axis] = float(np.nanmin(ends)), float(np.nanmax(ends))
    return found
