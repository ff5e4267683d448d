"""Checks one recording of a dataset: its episodes against the rows of the table of throws, and its bytes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import column_of
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.manifest import FileEntry, Finding
from throwcollect.dataset.mcap_file import RecordGroup
from throwcollect.dataset.mcap_reader import McapContents, WholeEpisode, open_mcap, scan
from throwcollect.dataset.shard import rewrite
from throwcollect.dataset.throws_table import Row, ThrowsTable, judge_episode, place_columns
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import count_indexed
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, find_infinite_columns
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import Trial
from throwcollect.tasks.free_flight import ballistic_steps
from throwcollect.tasks.task import task_of
from throwcollect.units import NS_PER_S

_RELATIVE_TOLERANCE = 1e-9
"""Numbers that are judged again on another machine may differ in their last bits."""
_MOST_NAMED = 3
"""Most differing columns of a row that are named; the others are counted."""
_POSITION_M = 1e-11
_VELOCITY_MPS = 1e-10
"""Largest errors of rounding from one sample of a flight to the next."""
_AFTER_CONTACT_S = 0.02
_AFTER_CONTACT_STEPS = 10
"""The contact solver may act on an object for some steps after its normal force has gone: up to 12 ms were seen."""


@dataclass
class RecordingReport:
    """What was found in one file.

    Attributes:
        findings: What is wrong.
        has_file: Whether there should be a file: no trial without an episode needs one.
        summary: What the bag's metadata should state of the file; None if it does not have all its episodes.
        entry: What the manifest should state of the file; None if not all its bytes are right.
        channels: What it records; None if that cannot be read.
        digests: Digest of each episode that it should have and that is whole, by trial.
    """

    findings: list[Finding] = field(default_factory=list)
    has_file: bool = False
    summary: FileSummary | None = None
    entry: FileEntry | None = None
    channels: Channels | None = None
    digests: dict[int, str] = field(default_factory=dict)


def check_recording(path: Path, plan: Plan, rows: Mapping[int, Row], *, robot: bool) -> RecordingReport:
    """Check the file of some trials.

    Args:
        path: The file.
        plan: All trials.
        rows: Rows of all trials of the file, by trial, also of those without an episode.
        robot: Whether the model of the robot is available, without which no episode is judged.
    """
    check = _RecordingCheck(path.name, plan, rows, robot=robot)
    for trial, row in rows.items():
        if row["shard"] is None:
            check.compare_row_without_episode(plan.trial(trial), row)
    if any(row["shard"] is not None for row in rows.values()):
        check.report.has_file = True
        try:
            with open_mcap(path) as contents:
                check.check_contents(contents)
        except DatasetError as error:
            check.report.findings.append(Finding.of(path.name, error))
    return check.report


class _RecordingCheck:
    """Checks one file; see `check_recording`."""

    def __init__(self, name: str, plan: Plan, rows: Mapping[int, Row], *, robot: bool) -> None:
        self._name = name
        self._plan = plan
        self._rows = rows
        self._robot = robot
        self._table = ThrowsTable.of(plan)
        self.report = RecordingReport()

    def _add(self, place: str, problem: str, *, file: str | None = None) -> None:
        self.report.findings.append(Finding(file or self._name, place, problem))

    def compare_row_without_episode(self, trial: Trial, row: Row) -> None:
        """Compare a row with the one that its trial should have, which was refused, or lost for some reason."""
        if trial.refused is not None:
            expected = self._table.make_refused_row(trial)
        else:
            expected = self._table.row(trial, task_of(self._plan.config).lose(row["reason"] or ""), None)
        for problem in _compare_rows(row, expected):
            self._add(f"trial {trial.number}", problem, file=THROWS)

    def check_contents(self, contents: McapContents) -> None:
        """Check everything in the file."""
        self.report.channels = channels = Channels(self._plan.config, contents.read_robot_description())
        waiting = {trial: row for trial, row in self._rows.items() if row["shard"] is not None}
        # Trials of merged plans have the numbers in their episodes that they were collected by.
        first = self._plan.first_of_part(next(iter(self._rows)))
        runs: dict[int, RecordGroup] = {}
        for stored in scan(contents):
            number = stored.episode.header.trial
            row = waiting.pop(first + number, None)
            if row is None:
                self._add(f"byte {stored.run.offset}", f"an episode that {THROWS} does not place here: trial {number}")
                continue
            place = f"trial {row['trial']}"
            runs[number] = stored.run
            self.report.digests[row["trial"]] = stored.episode.digest
            for problem in self._find_problems(stored, row, channels):
                self._add(place, problem)
        for row in waiting.values():
            self._add(f"trial {row['trial']}", _explain_missing(contents, row))
        if not waiting:
            finished, place_of_difference = rewrite(contents, channels, runs, name=self._name)
            if place_of_difference is not None:
                self._add(f"byte {place_of_difference}", "from here on, it is not what is written for its episodes")
            if finished.recording is not None:
                self.report.summary, entry = finished.recording
                self.report.entry = entry if place_of_difference is None else None

    def _find_problems(self, stored: WholeEpisode, row: Row, channels: Channels) -> Iterator[str]:
        """Find what is wrong with an episode, given the row of its trial, a sentence each."""
        episode, trial = stored.episode, self._plan.trial(row["trial"])
        place = place_columns(self._name, stored.run.offset, episode)
        try:
            config = self._plan.config_of(trial)
            if (found := tuple(episode.table.columns)) != channels.numbers:
                yield f"has the channels {list(found)} instead of {list(channels.numbers)}"
            yield from find_sensor_problems(episode, config, channels)
            if (start_ns := config.trial_start_ns(episode.header.trial)) != episode.header.start_ns:
                yield f"starts at {episode.header.start_ns} ns, the trial's slot of time at {start_ns} ns"
            if infinite := list(find_infinite_columns(episode.samples())):
                yield from infinite
                return
            yield from find_flight_problems(episode, config)
            expected = {**_planned_columns(trial), **place}
            if self._robot:
                expected = self._table.row(trial, judge_episode(config, episode), place)
        except (ConfigError, DatasetError) as error:
            yield str(error)
            return
        yield from _compare_rows(row, expected)


def find_sensor_problems(episode: Episode, config: Config, channels: Channels) -> Iterator[str]:
    """Find channels of sensors with another number of frames than they should have, a sentence each."""
    expected = Counter[int]()
    for name, topics in channels.sensors.items():
        stride = config.record.rate_hz // config.sensors[name].rate_hz
        expected.update(dict.fromkeys(topics, len(range(0, episode.header.samples, stride))))
    found = Counter[int]()
    for chunk in episode.sensors:
        found.update({number: count_indexed(index) for number, index in chunk.indexes.items()})
    for number in sorted(found.keys() | expected.keys()):
        if found[number] != expected[number]:
            yield f"has {found[number]} frames on channel {number} instead of {expected[number]}"


def _planned_columns(trial: Trial) -> Row:
    return {"trial": trial.number, **{column_of(key): value for key, value in trial.values.items()}, **trial.target}


def _compare_rows(row: Row, expected: Row) -> Iterator[str]:
    wrong = [name for name, value in expected.items() if not _are_same(value, row[name])]
    if wrong:
        named = ", ".join(f"{name} = {row[name]!r} instead of {expected[name]!r}" for name in wrong[:_MOST_NAMED])
        more = f"; {len(wrong) - _MOST_NAMED} more columns differ" if len(wrong) > _MOST_NAMED else ""
        yield f"{THROWS} has {named}{more}"


def _are_same(value: Any, other: Any) -> bool:
    # The same build computes equal numbers, so `isclose` is rarely needed.
    return bool(value == other) or (
        isinstance(value, float)
        and isinstance(other, float)
        and math.isclose(value, other, rel_tol=_RELATIVE_TOLERANCE, abs_tol=_RELATIVE_TOLERANCE)
    )


def _explain_missing(contents: McapContents, row: Row) -> str:
    """Explain why a file has no whole episode of a trial, whose place is in its row."""
    try:
        contents.whole_episode(row["chunk_offset"])
    except DatasetError as error:
        return f"has no whole episode: {error.details}"
    return f"has no whole episode: at byte {row['chunk_offset']} is another one"


def find_flight_problems(episode: Episode, config: Config) -> Iterator[str]:
    """Find departures of the object from ballistic motion where nothing touches it, a sentence each."""
    samples, steps = episode.samples(), config.sim.physics_hz // config.record.rate_hz
    if len(samples) < 2:
        return
    position, velocity = ballistic_steps(
        samples.object_position[:-1], samples.object_linear_velocity[:-1], steps=steps, config=config
    )
    apart_m = np.linalg.norm(samples.object_position[1:] - position, axis=1)
    apart_mps = np.linalg.norm(samples.object_linear_velocity[1:] - velocity, axis=1)
    wrong = _find_free_intervals(episode.header, samples.stamps_ns, config.sim.physics_hz) & (
        (apart_m > _POSITION_M) | (apart_mps > _VELOCITY_MPS)
    )
    if wrong.any():
        time_s = episode.header.seconds_at(int(samples.stamps_ns[1:][wrong][0]))
        yield (
            f"the {config.acted_on} departs from ballistic motion by up to {apart_m[wrong].max():.3g} m and "
            f"{apart_mps[wrong].max():.3g} m/s, first at {time_s:.3f} s, where no contact is"
        )


def _find_free_intervals(header: EpisodeHeader, stamps_ns: NDArray[np.int64], physics_hz: int) -> NDArray[np.bool_]:
    """Find the intervals between samples in which no contact acts, shape ``(n_samples - 1,)``."""
    after_ns = max(_AFTER_CONTACT_S, _AFTER_CONTACT_STEPS / physics_hz) * NS_PER_S
    begins, ends = stamps_ns[:-1], stamps_ns[1:]
    free = np.ones(len(begins), dtype=bool)
    for contact in header.contacts:
        over = math.inf if contact.end_ns is None else contact.end_ns + after_ns
        free &= (ends < contact.start_ns) | (begins >= over)
    return free
