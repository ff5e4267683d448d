"""Checks one episode against itself, against its row in the table, and against physics."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.config.values import column_of
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.mcap_reader import StoredEpisode
from throwcollect.dataset.recorded_trial import RecordedTrial
from throwcollect.dataset.throws_table import EpisodePlace, Row, ThrowsTable
from throwcollect.dataset.verify_header import find_header_problems
from throwcollect.dataset.verify_motion import find_ball_problems, find_joint_problems
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import Samples, find_infinite_columns
from throwcollect.episode.topics import read_stamps
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.description import robot_of, touchable_bodies
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import trajectory_of
from throwcollect.units import NS_PER_S
from throwcollect.wording import format_count

_RELATIVE_TOLERANCE = 1e-9
"""Numbers that are judged again on another machine may differ in their last bits."""
_MOST_NAMED = 3
"""Most differing columns of a row that are named; the others are counted."""


class _TrialsOf:
    """Trials of a plan, with what they are simulated with, worked out once for all checks of an episode."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.table = ThrowsTable.of(plan)
        # One trial is enough, as all checks of an episode come before those of the next one.
        self.trial = lru_cache(maxsize=1)(plan.trial)
        self.config = lru_cache(maxsize=1)(lambda number: plan.config_of(self.trial(number)))
        self.trajectory = lru_cache(maxsize=1)(lambda number: trajectory_of(self.config(number)))


class EpisodeCheck:
    """Checks the episodes of one dataset.

    Args:
        plan: Its trials; None if they are not known, and then neither rows nor physics are checked.
        rows: Rows of the table of throws, by trial; where there is none, the episode is not compared with it.
        doubtful: Trials that are wrong in the plan; neither their rows nor their physics are checked.
        robot: Whether the robot's model is available, which the motion of the joints, the names of bodies that the ball
            touches, and the result of the trial need.
    """

    def __init__(
        self, plan: Plan | None, rows: Mapping[int, Row], *, doubtful: Collection[int] = (), robot: bool = True
    ) -> None:
        self._trials = _TrialsOf(plan) if plan else None
        self._rows = rows
        self._doubtful = doubtful
        self._robot = robot
        self._joints = robot_of(plan.config).joints if plan else None
        self._bodies = touchable_bodies(plan.config) if plan and robot else None

    def find_problems(self, stored: StoredEpisode, shard: str, channels: Channels | None) -> Iterator[str]:
        """Find everything that is wrong with an episode in the file `shard`, a sentence each.

        `channels` are what the dataset records; None if that is not known.
        """
        episode = stored.episode
        try:
            yield from _find_record_problems(stored)
        except DatasetError as error:
            yield str(error)
            return
        unreadable = list(self._find_layout_problems(episode, channels))
        yield from unreadable or self._find_physics_problems(episode)
        row = self._rows.get(episode.header.trial)
        if row is not None and not unreadable and episode.header.trial not in self._doubtful:
            expected = vars(_place_of(stored, shard))
            if self._robot:
                # The row made here takes the swept values from the plan, with which the table was compared already.
                swept = set(map(column_of, self._need_trials().plan.keys))
                expected = {name: value for name, value in self.row(stored, shard).items() if name not in swept}
            yield from _find_row_problems(expected, row)

    def row(self, stored: StoredEpisode, shard: str) -> Row:
        """Make the row that an episode in the file `shard` should have in the table of throws; needs the plan."""
        trials = self._need_trials()
        trial = trials.trial(stored.episode.header.trial)
        return trials.table.row(trial, self.judge(stored.episode), _place_of(stored, shard))

    def judge(self, episode: Episode) -> Result:
        """Say how the trial of an episode ended; needs the plan."""
        trials, number = self._need_trials(), episode.header.trial
        return judge_episode(trials.config(number), episode, trials.trajectory(number))

    def _need_trials(self) -> _TrialsOf:
        if self._trials is None:
            raise DatasetError("no plan says which trial it is")
        return self._trials

    def find_content_problems(self, episode: Episode, channels: Channels | None) -> Iterator[str]:
        """Yield a sentence for everything that is wrong with an episode, wherever it lies; see `find_problems`."""
        problems = list(self._find_layout_problems(episode, channels))
        yield from problems or self._find_physics_problems(episode)

    def _find_layout_problems(self, episode: Episode, channels: Channels | None) -> Iterator[str]:
        """Find what keeps an episode from being measured: wrong records, layout, trial or stamps."""
        try:
            samples = episode.samples(self._joints)
            episode.check_records()
        except DatasetError as error:
            yield str(error)
            return
        if channels is not None:
            yield from _find_message_problems(episode, channels)
        if self._trials is None or episode.header.trial in self._doubtful:
            return
        if episode.header.trial >= len(self._trials.plan.trials):
            yield f"the plan has {format_count(len(self._trials.plan.trials), 'trial')}"
            return
        try:
            config = self._trials.config(episode.header.trial)
        except ConfigError as error:
            yield f"the plan has values that cannot be: {error}"
            return
        yield from _find_stamp_problems(episode, samples, config)
        yield from _find_sensor_problems(episode)

    def _find_physics_problems(self, episode: Episode) -> Iterator[str]:
        """Find what the simulation cannot have recorded."""
        if self._trials is None or episode.header.trial in self._doubtful:
            return
        config = self._trials.config(episode.header.trial)
        samples = episode.samples()
        if infinite := list(find_infinite_columns(samples)):
            yield from infinite
            return
        trial = RecordedTrial(samples, episode.header, config, self._trials.trajectory(episode.header.trial))
        # Numbers that somebody forged may overflow in these computations.
        with np.errstate(all="ignore"):
            problems = list(find_header_problems(trial, self._bodies))
            if self._robot:
                problems += find_joint_problems(trial)
            problems += find_ball_problems(trial)
        yield from problems


def _place_of(stored: StoredEpisode, shard: str) -> EpisodePlace:
    return EpisodePlace(shard, stored.offset, stored.episode.header.samples, stored.episode.digest)


def _find_row_problems(expected: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    # A dataset of an earlier version has fewer columns.
    wrong = [name for name, value in expected.items() if name in row and not _are_same(value, row[name])]
    if wrong:
        told = ", ".join(
            f"{name} = {row[name]!r}, the episode gives {expected[name]!r}" for name in wrong[:_MOST_NAMED]
        )
        more = f"; {len(wrong) - _MOST_NAMED} more columns differ" if len(wrong) > _MOST_NAMED else ""
        yield f"throws.parquet has {told}{more}"


def _find_message_problems(episode: Episode, channels: Channels) -> Iterator[str]:
    if not channels.fit(episode.channels()):
        found, expected = (
            " and ".join(str(list(chunk)) for chunk in numbers) for numbers in (episode.channels(), channels.numbers)
        )
        yield f"has the channels {found} instead of {expected}"
        return
    for channel, topic in channels.recorded.items():
        messages = episode.table.messages(channel.id)
        if not topic.layout.describes(messages):
            yield f"messages of {topic.name} are not laid out as {topic.type_name} is written here"
            continue
        rows = messages.view(topic.layout.dtype)[:, 0]
        for stamp in topic.stamps:
            if not np.array_equal(read_stamps(rows, stamp), episode.table.log_times):
                yield f"stamps of {topic.name} ({stamp}) differ from the times of its records"


def _find_record_problems(stored: StoredEpisode) -> Iterator[str]:
    """Find differences between the records around chunks and those that the writer makes for these chunks."""
    run = stored.intact_run
    for chunk, expected in zip(stored.chunks, run.chunk_indexes, strict=True):
        first = expected.chunk_start_offset + expected.chunk_length
        indexes = b"".join(record.data for record in chunk.indexes.values())
        if indexes != run.data[first : first + expected.message_index_length]:
            yield f"the message indexes from byte {chunk.record.end} on do not fit the chunk"
    if stored.facts.data != run.data[len(run.data) - run.metadata_length :]:
        yield f"the metadata at byte {stored.facts.offset} do not fit the chunk (digest, trial or header)"


def _find_sensor_problems(episode: Episode) -> Iterator[str]:
    """Find what chunks of sensors cannot have recorded, a sentence each."""
    last_ns = episode.chunk.end_ns
    for number, sensor in enumerate(episode.sensors, start=1):
        messages, times = sensor.messages, sensor.messages.headers["log_time"]
        if (np.diff(times.astype(np.int64)) < 0).any():
            yield f"chunk {number}: the messages are not in order of their times"
        if times.min() < episode.header.start_ns or times.max() > last_ns:
            yield f"chunk {number}: has messages from {times.min()} to {times.max()} ns, the trial ends at {last_ns} ns"
        if (sensor.chunk.start_ns, sensor.chunk.end_ns) != (times.min(), times.max()):
            yield f"chunk {number}: its times differ from those of its messages"
        if not (np.array_equal(messages.stamps_ns, times) and np.array_equal(messages.headers["publish_time"], times)):
            yield f"chunk {number}: stamps differ from the times of the records"
        for channel in messages.channels:
            counted_up = messages.headers["sequence"][messages.headers["channel"] == channel]
            if not np.array_equal(counted_up, np.arange(len(counted_up))):
                yield f"chunk {number}: the messages of channel {channel} are not numbered from 0"


def _find_stamp_problems(episode: Episode, samples: Samples, config: Config) -> Iterator[str]:
    """Find everything that is wrong with the times of an episode and its samples, a sentence each."""
    stamps, header = samples.stamps_ns, episode.header
    if not episode.table.are_timed_by(stamps):
        yield "times or numbers of the message records differ from the stamps of /joint_states"
    if (header.start_ns, episode.chunk.start_ns, episode.chunk.end_ns) != (stamps[0], stamps[0], stamps[-1]):
        said = f"header {header.start_ns} ns, chunk {episode.chunk.start_ns} to {episode.chunk.end_ns} ns"
        yield f"times differ: {said}, stamps {stamps[0]} to {stamps[-1]} ns"
    if stamps[0] != config.trial_start_ns(header.trial):
        yield f"starts at {stamps[0]} ns, the trial's slot of time at {config.trial_start_ns(header.trial)} ns"
    steps = np.diff(stamps)
    # Stamps are whole nanoseconds, so their distances may differ by one.
    if len(steps) and np.abs(steps - NS_PER_S / config.record.rate_hz).max() > 1:
        yield f"stamps are not spaced by 1/{config.record.rate_hz} s: {steps.min()} to {steps.max()} ns"


def _are_same(value: object, other: object) -> bool:
    # The same build computes equal numbers, so `isclose` is rarely needed.
    return value == other or (
        isinstance(value, float)
        and isinstance(other, float)
        and math.isclose(value, other, rel_tol=_RELATIVE_TOLERANCE, abs_tol=_RELATIVE_TOLERANCE)
    )
