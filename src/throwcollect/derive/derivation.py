"""Writes a derived dataset: the one that a collection of its list of trials would have given."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any

from throwcollect.config.schema import Config
from throwcollect.dataset.creation import create
from throwcollect.dataset.damage import locating_damage
from throwcollect.dataset.directory import CARD, SOURCES
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import Row, ThrowsTable
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.derive.origins import encode_sources, sources_section
from throwcollect.derive.source import Source
from throwcollect.derive.trial_list import list_of_trials
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.restamp import Restamper
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import new_directory, write_file
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import full_description
from throwcollect.sweep.digest import trial_digests
from throwcollect.sweep.plan import Plan, make_trials
from throwcollect.sweep.points import Points

_ROWS_AT_ONCE = 256
_MOST_THREADS = 4
"""Only compressing and hashing run side by side; the rest holds the interpreter's lock, so more threads do not help."""


@dataclass(frozen=True)
class Derived:
    """A dataset that was made from others.

    Attributes:
        trials: Number of its trials, each of which has an episode.
        offered: Number of trials of its sources.
        without_episode: Number of trials that were asked for but have no episode, by outcome; they are left out.
        digest: Its digest.
        repeated: Number of trials that more than one of its sources has, so that the dataset has them several times.
    """

    trials: int
    offered: int
    without_episode: Mapping[str, int]
    digest: str
    repeated: int

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary, for JSON."""
        return asdict(self)


def derive(sources: Sequence[Source], output: Path, *, name: str | None = None) -> Derived:
    """Make the dataset that consists of the trials of some others, at least one, in their order, renumbered from 0.

    Its directory must be new or empty, and nothing is left there after an error. Without `name`, it has the name of the
    first source.
    """
    with new_directory(output) as directory:
        return _write(sources, directory, name)


def _write(sources: Sequence[Source], directory: Path, name: str | None) -> Derived:
    began = time.monotonic()
    config, points = list_of_trials(sources)
    if not len(points.values):
        raise ConfigError("no trial with an episode is left", expected="at least one")
    if name is not None:
        config = config.model_copy(update={"name": name})
    # Every trial has been run before, so the plan need not check any.
    plan = Plan(config, make_trials(config, points))
    # The sources hold the description of their robot, so its package need not be installed.
    channels = Channels(config, sources[0].dataset.robot_description() or full_description(config))
    create(directory, plan, listed=points)
    with closing(DatasetWriter(directory, plan, channels=channels)) as writer:
        write_file(directory / SOURCES, encode_sources(sources))
        table = ThrowsTable.of(plan)
        restamped = _restamp_episodes(sources, Restamper(config, channels))
        for episode, row in log_progress(restamped, len(plan.trials), "trial", "written"):
            if table.later <= row.keys():
                result = table.result(row)
            else:
                # An earlier version wrote the row, and did not measure all columns.
                result = judge_episode(plan.config_of(plan.trial(episode.header.trial)), episode)
            writer.append(episode, result)
        writer.finish(wall_s=time.monotonic() - began)
    # The manifest does not cover the card, so it may grow after the dataset is finished.
    card = (directory / CARD).read_text(encoding="utf-8")
    write_file(directory / CARD, (card + sources_section(sources)).encode())
    without = sum((Counter(each.without_episode) for each in sources), Counter[str]())
    return Derived(
        trials=len(plan.trials),
        offered=sum(len(each.dataset.throws) for each in sources),
        without_episode=dict(sorted(without.items())),
        digest=Dataset.open(directory).digest,
        repeated=_count_repeated(sources, config, points),
    )


def _count_repeated(sources: Sequence[Source], config: Config, points: Points) -> int:
    """Count the trials that more than one source has; the points are those of all sources, one after the other."""
    if len(sources) == 1:
        return 0
    # All seeds are taken as 0, as they follow from the numbers of trials, which differ between datasets.
    digests = iter(trial_digests(config, points, [0] * len(points.values)))
    held = [{digest.tobytes() for digest in islice(digests, len(source.trials))} for source in sources]
    return sum(count > 1 for count in Counter(chain.from_iterable(held)).values())


def _restamp_episodes(sources: Sequence[Source], restamper: Restamper) -> Iterator[tuple[Episode, Row]]:
    """Restamp episodes to their new numbers, in order, each with its row in the table of its source."""
    threads = min(_MOST_THREADS, os.cpu_count() or 1)
    pending: deque[tuple[Future[Episode], Row]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        for number, (dataset, row) in enumerate(_list_rows(sources)):
            pending.append((pool.submit(_restamp, restamper, dataset, row, number), row))
            # More episodes than this would only wait in memory, as they are written in order by one thread.
            if len(pending) > 2 * threads:
                yield _take_result(pending)
        while pending:
            yield _take_result(pending)


def _take_result(pending: deque[tuple[Future[Episode], Row]]) -> tuple[Episode, Row]:
    future, row = pending.popleft()
    return future.result(), row


def _list_rows(sources: Sequence[Source]) -> Iterator[tuple[Dataset, Row]]:
    for each in sources:
        for start in range(0, len(each.trials), _ROWS_AT_ONCE):
            numbers = each.trials[start : start + _ROWS_AT_ONCE]
            for row in each.dataset.throws.take(numbers).to_pylist():
                yield each.dataset, row


def _restamp(restamper: Restamper, dataset: Dataset, row: Row, number: int) -> Episode:
    with locating_damage(dataset, row["trial"]):
        episode = dataset.episode(row["trial"])
        if episode.digest != row["digest"]:
            raise DatasetError(f"digest {episode.digest}", expected=f"{row['digest']} as throws.parquet says")
        return restamper.restamp(episode, number)
