"""Motions of a file: the points of each over time, as one table of numbers, whatever kind of file they were in."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.motion import MotionFile
from throwcollect.config.section import unknown_joint
from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.robot import Robot
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.motion_files import MOTION, TIME, columns_of, pa, read_motion_table
from throwcollect.wording import format_count, join_names

KEY = "task.trajectory.motion"
"""Dotted key with the number of a trial's motion."""
SAME = 1e-6
"""Positions that differ by less are one [rad; m]."""
_MOST_KEPT = 2
_KEPT: dict[str | None, Motions] = {}


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions of the same joints.

    Attributes:
        names: Their names, ``(n_motions,)``.
        joints: Joints that they move, in the order of `Robot.joints`.
        offsets: Motion i has the points from ``offsets[i]`` to ``offsets[i + 1]``, not included; ``(n_motions + 1,)``.
        columns: ``time_s`` and, by the names of `columns_of`, positions, and possibly velocities and accelerations of
            all joints, each of shape ``(n_points,)``.
    """

    names: tuple[str, ...]
    joints: tuple[str, ...]
    offsets: NDArray[np.int64]
    columns: Mapping[str, NDArray[np.float64]]

    @classmethod
    def of(cls, trajectories: Mapping[str, JointTrajectory], robot: Robot) -> Motions:
        """Make the motions of trajectories of the same joints, by their names."""
        each = list(trajectories.values())
        columns = {TIME: np.concatenate([one.times for one in each])}
        for order, name in enumerate(("positions", "velocities", "accelerations")):
            rows = np.vstack([getattr(one, name) for one in each])
            columns |= {columns_of(joint, robot)[order]: rows[:, n] for n, joint in enumerate(each[0].joints)}
        offsets = np.cumsum([0, *(len(one.times) for one in each)])
        return cls(tuple(trajectories), each[0].joints, offsets, columns)

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def digest(self) -> str:
        """SHA-256 over names and all numbers, in hexadecimal."""
        digest = hashlib.sha256(json.dumps([self.names, list(self.columns)]).encode())
        digest.update(self.offsets.astype("<i8").tobytes())
        for values in self.columns.values():
            digest.update(np.ascontiguousarray(values, "<f8").data)
        return digest.hexdigest()

    def table(self) -> Any:
        """Make the Arrow table of all points, which a Parquet file of motions has."""
        numbers = np.repeat(np.arange(len(self), dtype=np.int32), np.diff(self.offsets))
        return pa.table({MOTION: pa.DictionaryArray.from_arrays(numbers, self.names).cast(pa.string()), **self.columns})

    def number_of(self, motion: float | str | None) -> int:
        """Find the number of a motion; without a number or a name, it is the first one."""
        if isinstance(motion, str):
            number = self.names.index(motion) if motion in self.names else len(self)
        else:
            number = int(motion or 0)
        if number >= len(self):
            there = f"the file has {format_count(len(self), 'motion')}: {', '.join(self.names[:5])}, ..."
            raise ConfigError(
                [Problem(f"there is no motion {motion if isinstance(motion, str) else number}; {there}", KEY)]
            )
        return number

    @cached_property
    def ends(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        """Positions of each joint at the ``start`` and at the ``end`` of all motions, ``(n_motions,)``."""
        rows = {"start": self.offsets[:-1], "end": self.offsets[1:] - 1}
        columns = list(self.columns.values())[1 : 1 + len(self.joints)]
        return {
            name: {joint: column[row] for joint, column in zip(self.joints, columns, strict=True)}
            for name, row in rows.items()
        }

    def trajectory(self, number: int) -> JointTrajectory:
        """Make the trajectory of a motion.

        Velocities and accelerations that the file does not have are differences; velocities are 0 at both ends.
        """
        times, *columns = (column[self.offsets[number] : self.offsets[number + 1]] for column in self.columns.values())
        count = len(self.joints)
        orders = [np.column_stack(columns[first : first + count]) for first in range(0, len(columns), count)]
        while len(orders) < 3:
            orders.append(np.gradient(orders[-1], times, axis=0))
            if len(orders) == 2:
                orders[1][[0, -1]] = 0
        return JointTrajectory(self.joints, times, *orders)


def motions_of(family: MotionFile, robot: Robot) -> Motions:
    """Read the motions of a section, and make sure that they are those of its digest, if it has one."""
    if (kept := _KEPT.get(family.sha256)) is not None:
        return kept
    motions = _make_motions(read_motion_table(family, robot), robot, Path(family.file))
    if family.sha256 not in (None, motions.digest):
        raise ConfigError(
            f"{family.file}: its motions are not those of task.trajectory.sha256",
            hint="restore a dataset by throwcollect up CONFIG --resume DIR",
        )
    while len(_KEPT) >= _MOST_KEPT:
        _KEPT.pop(next(iter(_KEPT)))
    # What is kept is found by its digest, so it never is that of an older file.
    return _KEPT.setdefault(motions.digest, motions)


def complete(family: MotionFile, robot: Robot, start: Mapping[str, float], end: Mapping[str, float]) -> dict[str, Any]:
    """Make the keys of a task that follow from its file of motions: ``trajectory``, and ``start`` and ``end``.

    The latter are those of the first motion, but for joints that the given ones name.
    """
    motions = motions_of(family, robot)
    first = motions.number_of(family.motion)
    ends = {
        name: {joint: float(positions[first]) for joint, positions in found.items()}
        for name, found in motions.ends.items()
    }
    motion = None if family.motion is None else float(first)
    section = family.model_copy(update={"sha256": motions.digest, "motion": motion})
    return {"trajectory": section, "start": ends["start"] | {**start}, "end": ends["end"] | {**end}}


def file_trajectory(
    start: Mapping[str, float], end: Mapping[str, float], *, family: MotionFile, robot: Robot
) -> JointTrajectory:
    """Return the points of a motion of a file, which has to lead from the start to the end of the trial."""
    motions = motions_of(family, robot)
    number = motions.number_of(family.motion)
    for name, wanted in (("start", start), ("end", end)):
        found = {joint: positions[number] for joint, positions in motions.ends[name].items()}
        for joint, position in found.items():
            if joint not in wanted or abs(position - wanted[joint]) > SAME:
                sentence = f"should be {position:.6g}, the {name} of its motion, or left out"
                raise ConfigError([Problem(f"{sentence}; got {wanted.get(joint)}", f"task.{name}.{joint}")])
        if name == "end" and len(end) > len(found):
            raise ConfigError([Problem(f"should name only {join_names(list(found))}, as the file does", "task.end")])
    return motions.trajectory(number)


def _make_motions(table: Any, robot: Robot, path: Path) -> Motions:
    """Check a table of points, and put its columns in order."""
    there = {*table.column_names} - {MOTION, TIME}
    joints = tuple(joint for joint in robot.joints if there & {*columns_of(joint, robot)})
    by_order = list(zip(*(columns_of(joint, robot) for joint in joints), strict=True))
    orders = 1 + max((number for number, names in enumerate(by_order) if there & {*names}), default=0)
    wanted = [TIME, *(name for names in by_order[:orders] for name in names)]
    wrong = {name: _explain_column(name, robot) for name in sorted(there - {*wanted})}
    wrong = wrong or {name: "the column is missing" for name in wanted if name not in table.column_names}
    if wrong or not len(table):
        problems = [Problem(sentence, name, path) for name, sentence in wrong.items()]
        raise ConfigError(problems or [Problem("has no points", path=path)])
    encoded = table[MOTION].cast("string").fill_null("").combine_chunks().dictionary_encode()
    starts = np.append(0, np.flatnonzero(np.diff(encoded.indices.to_numpy())) + 1)
    names = tuple(encoded.take(starts).to_pylist())
    columns = {}
    for name in wanted:
        columns[name] = _read_numbers(table, name, path)
        # The memory of a column is free again before the next one is copied.
        table = table.drop_columns([name])
    motions = Motions(names, joints, np.append(starts, len(encoded)), columns)
    if problem := next(_find_problems(motions), None):
        raise ConfigError([Problem(problem, path=path)])
    return motions


def _explain_column(name: str, robot: Robot) -> str:
    joint = name if name in robot.joints else name.rpartition("_")[0] or name
    if joint not in robot.joints:
        return unknown_joint(joint, robot)
    return f"should be {join_names(columns_of(joint, robot), 'or')}"


def _read_numbers(table: Any, name: str, path: Path) -> NDArray[np.float64]:
    try:
        numbers: NDArray[np.float64] = table[name].cast("float64").to_numpy()
    except (KeyError, ValueError) as error:
        # A name may be there twice; Arrow's errors are errors of values.
        raise ConfigError([Problem(f"should be one column of numbers: {error}", name, path)]) from error
    return numbers


def _find_problems(motions: Motions) -> Iterator[str]:
    """Find the first number of each kind that no motion has."""
    times, offsets, names = motions.columns[TIME], motions.offsets, motions.names
    if len(set(names)) < len(names):
        twice = next(name for number, name in enumerate(names) if name in names[:number])
        yield f"the points of motion {twice!r} should follow each other"
    begins, ends = offsets[:-1], offsets[1:] - 1
    # The times of each motion begin at 0 again.
    rising = np.append(True, np.diff(times) > 0)
    rising[begins] = True
    at_rest = np.append(begins, ends)
    count, columns = len(motions.joints), motions.columns
    found = [(name, np.flatnonzero(~np.isfinite(values)), "should be a number") for name, values in columns.items()]
    found.append((TIME, begins[begins == ends], "should be that of 2 points or more"))
    found.append((TIME, begins[times[begins] != 0], "should begin at 0"))
    found.append((TIME, np.flatnonzero(~rising), "should rise"))
    for name in [*columns][1 + count : 1 + 2 * count]:
        rows = at_rest[np.abs(columns[name][at_rest]) > SAME]
        found.append((name, rows, "should be 0, as motions begin and end at rest"))
    for name, rows, sentence in found:
        if len(rows):
            number = int(np.searchsorted(offsets, rows[0], side="right")) - 1
            place = f"motion {names[number]!r}, point {rows[0] - offsets[number] + 1}"
            yield f"{place}: {name} {sentence}, got {columns[name][rows[0]]:g}"
