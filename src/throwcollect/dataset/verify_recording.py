"""Checks one recording of a dataset: its episodes against the rows of the table of throws, and its bytes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.manifest import Finding
from throwcollect.dataset.mcap_file import RecordGroup
from throwcollect.dataset.mcap_reader import McapContents, WholeEpisode, open_mcap, scan
from throwcollect.dataset.recovery import check_recorded
from throwcollect.dataset.shard import Recording, rewrite
from throwcollect.dataset.throws_table import Row, ThrowsTable, judge_episode, place_columns
from throwcollect.episode.channels import Channels
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


class RecordingCheck:
    """Checks the file of some trials.

    Attributes:
        findings: What is wrong.
        recording: What bag metadata and manifest should state of the file; None if something is wrong with its bytes.
    """

    def __init__(self, path: Path, plan: Plan, rows: Mapping[int, Row], *, robot: bool) -> None:
        """Check a file.

        Args:
            path: The file.
            plan: All trials.
            rows: Rows of all trials of the file, by trial, also of those without an episode.
            robot: Whether the model of the robot is available, without which no episode is judged.
        """
        self._name, self._plan, self._robot, self._table = path.name, plan, robot, ThrowsTable.of(plan)
        self.findings: list[Finding] = []
        self.recording: Recording | None = None
        for trial, row in rows.items():
            if row["shard"] is None:
                for problem in _compare_rows(row, self._make_row_without_episode(plan.trial(trial), row)):
                    self.findings.append(Finding(THROWS, f"trial {trial}", problem))
        waiting = {trial: row for trial, row in rows.items() if row["shard"] is not None}
        if waiting:
            try:
                with open_mcap(path) as contents:
                    self._check_contents(contents, waiting)
            except DatasetError as error:
                self.findings.append(Finding.of(path.name, error))

    def _add(self, place: str, problem: str) -> None:
        self.findings.append(Finding(self._name, place, problem))

    def _make_row_without_episode(self, trial: Trial, row: Row) -> Row:
        """Make the row that a trial should have which was refused, or lost for some reason."""
        if trial.refused is not None:
            return self._table.make_refused_row(trial)
        return self._table.row(trial, task_of(self._plan.config).lose(row["reason"] or ""), None)

    def _check_contents(self, contents: McapContents, waiting: dict[int, Row]) -> None:
        """Check everything in the file, which should have the episodes of these rows."""
        channels = Channels(self._plan.config, contents.read_robot_description())
        # Trials of merged plans have the numbers in their episodes that they were collected by.
        first = self._plan.first_of_part(next(iter(waiting)))
        runs: dict[int, RecordGroup] = {}
        for stored in scan(contents):
            number = stored.episode.header.trial
            row = waiting.pop(first + number, None)
            if row is None:
                self._add(f"byte {stored.run.offset}", f"an episode that {THROWS} does not place here: trial {number}")
                continue
            runs[number] = stored.run
            for problem in self._find_problems(stored, row, channels):
                self._add(f"trial {row['trial']}", problem)
        for row in waiting.values():
            self._add(f"trial {row['trial']}", _explain_missing(contents, row))
        if not waiting:
            finished, difference = rewrite(contents, channels, runs, name=self._name)
            if difference is not None:
                self._add(f"byte {difference}", "from here on, it is not what is written for its episodes")
            else:
                self.recording = finished.recording

    def _find_problems(self, stored: WholeEpisode, row: Row, channels: Channels) -> Iterator[str]:
        """Find what is wrong with an episode, given the row of its trial, a sentence each."""
        episode, trial = stored.episode, self._plan.trial(row["trial"])
        place = place_columns(self._name, stored.run.offset, episode)
        try:
            if infinite := list(find_infinite_columns(episode.samples())):
                yield from infinite
                return
            config = self._plan.config_of(trial)
            check_recorded(config, episode, channels)
            yield from find_flight_problems(episode, config)
            if self._robot:
                expected = self._table.row(trial, judge_episode(config, episode), place)
            else:
                expected = self._table.start_row(trial) | place
        except (ConfigError, DatasetError) as error:
            yield str(error)
            return
        yield from _compare_rows(row, expected)


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
