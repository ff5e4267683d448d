"""Checks one episode against itself, against its row in the table, and against physics."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.dataset.judging import judged
from throwcollect.dataset.mcap_file import EpisodeRun, episode_run
from throwcollect.dataset.mcap_reader import StoredEpisode
from throwcollect.dataset.throws_table import Place, ThrowsTable
from throwcollect.dataset.verify_header import header_problems
from throwcollect.dataset.verify_motion import ball_problems, infinite_columns, joint_problems
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode
from throwcollect.episode.record import Samples
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.description import touchable_bodies
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.trajectory import throw_trajectory
from throwcollect.wording import counted

_RELATIVE_TOLERANCE = 1e-9
"""Numbers that are judged again on another machine may differ in their last bits."""
_MOST_TOLD = 3
"""Columns of a row that are told one by one."""
_NS_PER_S = 1_000_000_000


class RowJudge:
    """Makes the rows of the table of throws anew, from episodes as they lie in their files.

    Args:
        plan: The plan that has their trials.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._table = ThrowsTable(plan.keys, tuple(plan.config.task.end))

    def row(self, stored: StoredEpisode, shard: str) -> dict[str, Any]:
        """The row of an episode.

        Args:
            stored: The episode.
            shard: Name of its file.

        Raises:
            DatasetError: If the episode is damaged.
        """
        episode = stored.episode
        trial = self._plan.trials[episode.header.trial]
        place = Place(shard, stored.chunk.offset, episode.header.samples, episode.digest)
        return self._table.row(trial.number, trial.values, judged(self._plan.config_of(trial), episode), place)


class EpisodeCheck:
    """Checks the episodes of one dataset.

    Args:
        plan: Its trials; None if they are not known, and then neither rows nor physics are looked at.
        rows: Rows of the table of throws, by trial; where there is none, the episode is not compared with it.
        doubtful: Trials that the plan has wrong; neither rows nor physics of theirs are looked at.
    """

    def __init__(
        self, plan: Plan | None, rows: Mapping[int, Mapping[str, Any]], *, doubtful: Collection[int] = ()
    ) -> None:
        self._plan = plan
        self._rows = rows
        self._doubtful = doubtful
        self._judge = RowJudge(plan) if plan else None
        self._bodies = touchable_bodies() if plan else frozenset()

    def problems(self, stored: StoredEpisode, shard: str, channels: Channels | None) -> Iterator[str]:
        """Everything that is wrong with an episode.

        Args:
            stored: The episode as it lies in its file.
            shard: Name of that file.
            channels: What the dataset records; None if that is not known.

        Yields:
            What is wrong, a sentence each.
        """
        episode = stored.episode
        try:
            yield from _record_problems(stored, episode_run(episode))
        except DatasetError as error:
            yield str(error)
            return
        unreadable = list(self._layout_problems(episode, channels))
        yield from unreadable or self._physics_problems(episode)
        row = self._rows.get(episode.header.trial)
        if (
            self._judge is not None
            and row is not None
            and not unreadable
            and episode.header.trial not in self._doubtful
        ):
            # Swept values were compared with the plan, and that is where they come from here.
            judged_row = self._judge.row(stored, shard)
            yield from _row_problems({name: judged_row[name] for name in judged_row if "." not in name}, row)

    def content_problems(self, episode: Episode, channels: Channels | None) -> Iterator[str]:
        """Everything that is wrong with an episode wherever it lies.

        Args:
            episode: The episode.
            channels: What the dataset records; None if that is not known.

        Yields:
            What is wrong, a sentence each.
        """
        problems = list(self._layout_problems(episode, channels))
        yield from problems or self._physics_problems(episode)

    def _layout_problems(self, episode: Episode, channels: Channels | None) -> Iterator[str]:
        """What keeps an episode from being measured: by its records, its layout, its trial or its stamps."""
        try:
            samples = episode.samples()
            episode.check_records()
        except DatasetError as error:
            yield str(error)
            return
        if channels is not None:
            yield from _message_problems(episode, channels)
        if self._plan is None or episode.header.trial in self._doubtful:
            return
        if episode.header.trial >= len(self._plan.trials):
            yield f"the plan has {counted(len(self._plan.trials), 'trial')}"
            return
        try:
            config = self._plan.config_of(self._plan.trials[episode.header.trial])
        except ConfigError as error:
            yield f"the plan has values that cannot be: {error}"
            return
        yield from stamp_problems(episode, samples, config)

    def _physics_problems(self, episode: Episode) -> Iterator[str]:
        """What the simulation cannot have recorded."""
        if self._plan is None or episode.header.trial in self._doubtful:
            return
        config = self._plan.config_of(self._plan.trials[episode.header.trial])
        samples = episode.samples()
        if infinite := list(infinite_columns(samples)):
            yield from infinite
            return
        trajectory, header = throw_trajectory(config), episode.header
        # Numbers of a forger may be as large as they like.
        with np.errstate(all="ignore"):
            problems = [
                *header_problems(samples, header, config=config, trajectory=trajectory, bodies=self._bodies),
                *joint_problems(samples, header, config=config, trajectory=trajectory),
                *ball_problems(samples, header, config=config),
            ]
        yield from problems


def _row_problems(expected: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    wrong = [name for name, value in expected.items() if not _same(value, row[name])]
    if wrong:
        told = ", ".join(f"{name} = {row[name]!r}, the episode gives {expected[name]!r}" for name in wrong[:_MOST_TOLD])
        more = f"; {len(wrong) - _MOST_TOLD} more columns differ" if len(wrong) > _MOST_TOLD else ""
        hint = "; to have it judged anew: throwcollect dataset rebuild" if "outcome" in wrong else ""
        yield f"throws.parquet has {told}{more}{hint}"


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
    indexes = b"".join(record.data for record in stored.indexes.values())
    first = len(stored.chunk.data)
    if indexes != run.data[first : first + run.chunk_index.message_index_length]:
        yield f"the message indexes from byte {start + first} on do not fit the chunk"
    if stored.facts.data != run.data[len(run.data) - run.metadata_length :]:
        yield f"the metadata at byte {stored.facts.offset} do not fit the chunk (digest, trial or header)"


def stamp_problems(episode: Episode, samples: Samples, config: Config) -> Iterator[str]:
    """Everything that is wrong with the times of an episode.

    Args:
        episode: The episode.
        samples: Its samples.
        config: Configuration of its trial.

    Yields:
        What is wrong, a sentence each.
    """
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
