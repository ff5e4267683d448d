"""Checks one episode against itself, against its row in the table, and against physics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.dataset.mcap_file import EpisodeRun, episode_run
from throwcollect.dataset.mcap_reader import StoredEpisode
from throwcollect.dataset.throws import Place, ThrowsTable
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode
from throwcollect.episode.record import Samples
from throwcollect.errors import DatasetError
from throwcollect.robots.model import joint_limits
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.flight import flight_residual
from throwcollect.tasks.throw import judge
from throwcollect.tasks.trajectory import throw_trajectory

BALLISTIC_TOLERANCE_M = 1e-9
"""A recorded flight and the computed one differ by rounding, below 1e-12 m; the smallest kick moves a ball by more."""
_RELATIVE_TOLERANCE = 1e-9
"""Numbers that are judged again on another machine may differ in their last bits."""
_NS_PER_S = 1_000_000_000


class EpisodeCheck:
    """Checks the episodes of one dataset.

    Args:
        plan: Its trials.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._table = ThrowsTable(plan.keys, tuple(plan.config.task.end))
        self._limits = joint_limits()

    def problems(self, stored: StoredEpisode, row: Mapping[str, Any], channels: Channels) -> Iterator[str]:
        """Everything that is wrong with an episode.

        Args:
            stored: The episode as it lies in its file.
            row: Its row in the table of throws.
            channels: What the dataset records.

        Yields:
            What is wrong, a sentence each.
        """
        episode = stored.episode
        try:
            run = episode_run(episode)
            samples = episode.samples()
        except DatasetError as error:
            yield str(error)
            return
        try:
            episode.check_records()
        except DatasetError as error:
            yield str(error)
        yield from _record_problems(stored, run)
        yield from _message_problems(episode, channels)
        config = self._plan.config_of(self._plan.trials[episode.header.trial])
        yield from _stamp_problems(episode, samples, config)
        yield from self._row_problems(stored, samples, config, row)
        residual = flight_residual(samples, episode.header, config=config)
        if residual is not None and not residual <= BALLISTIC_TOLERANCE_M:
            yield f"the flight departs from ballistic motion by {residual:.3g} m"

    def _row_problems(
        self, stored: StoredEpisode, samples: Samples, config: Config, row: Mapping[str, Any]
    ) -> Iterator[str]:
        header = stored.episode.header
        result = judge(samples, header, config=config, trajectory=throw_trajectory(config), limits=self._limits)
        place = Place(row["shard"], stored.chunk.offset, header.samples, stored.episode.digest)
        values = self._plan.trials[header.trial].values
        for name, value in self._table.row(header.trial, values, result, place).items():
            if not _same(value, row[name]):
                yield f"throws.parquet has {name} = {row[name]!r}, the episode gives {value!r}"


def _message_problems(episode: Episode, channels: Channels) -> Iterator[str]:
    expected = {channel.id: topic for channel, topic in channels.recorded.items()}
    if list(episode.table.columns) != list(expected):
        yield f"has the channels {list(episode.table.columns)} instead of {list(expected)}"
        return
    for channel, topic in expected.items():
        messages = episode.table.messages(channel)
        if not topic.layout.describes(messages):
            yield f"messages of {topic.name} are not laid out as {topic.type_name} is written here"
            continue
        rows = messages.view(topic.layout.dtype)[:, 0]
        for name in topic.layout.dtype.names or ():
            if name.endswith(("stamp.sec", "clock.sec")):
                stamps = rows[name].astype(np.int64) * _NS_PER_S + rows[name.replace(".sec", ".nanosec")]
                if not np.array_equal(stamps, episode.table.log_times):
                    yield f"stamps of {topic.name} ({name.removesuffix('.sec')}) differ from the times of its records"


def _record_problems(stored: StoredEpisode, run: EpisodeRun) -> Iterator[str]:
    """Differences between the records around a chunk and what its contents call for."""
    start = stored.chunk.offset
    indexes = b"".join(record.data for record in stored.indexes)
    first = len(stored.chunk.data)
    if indexes != run.data[first : first + run.chunk_index.message_index_length]:
        yield f"the message indexes from byte {start + first} on do not fit the chunk"
    if stored.facts.data != run.data[len(run.data) - run.metadata_length :]:
        yield f"the metadata at byte {stored.facts.offset} do not fit the chunk (digest, trial or header)"


def _stamp_problems(episode: Episode, samples: Samples, config: Config) -> Iterator[str]:
    stamps, header = samples.stamps_ns, episode.header
    if not episode.table.are_timed_by(stamps):
        yield "times or numbers of the message records differ from the stamps of /joint_states"
    if (header.start_ns, episode.chunk.start_ns, episode.chunk.end_ns) != (stamps[0], stamps[0], stamps[-1]):
        said = f"header {header.start_ns} ns, chunk {episode.chunk.start_ns} to {episode.chunk.end_ns} ns"
        yield f"times differ: {said}, stamps {stamps[0]} to {stamps[-1]} ns"
    if stamps[0] != config.trial_start_ns(header.trial):
        yield f"starts at {stamps[0]} ns, the trial's slot of time at {config.trial_start_ns(header.trial)} ns"
    steps = np.diff(stamps)
    if len(steps) and np.abs(steps - _NS_PER_S / config.record.rate_hz).max() > 1:
        yield f"stamps are not spaced by 1/{config.record.rate_hz} s: {steps.min()} to {steps.max()} ns"


def _same(value: object, other: object) -> bool:
    if isinstance(value, float) and isinstance(other, float):
        return math.isclose(value, other, rel_tol=_RELATIVE_TOLERANCE, abs_tol=_RELATIVE_TOLERANCE)
    return value == other
