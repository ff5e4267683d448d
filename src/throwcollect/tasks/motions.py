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

from throwcollect.config.kinds import unknown_joint
from throwcollect.config.motion import MotionFile
from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.robot import Robot
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.motion_files import MOTION, TIME, columns_of, read_motion_table
from throwcollect.wording import format_count

KEY = "task.trajectory.motion"
"""Dotted key with the number of a trial's motion."""
_SAME = 1e-6
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
        import pyarrow as pa

        numbers = np.repeat(np.arange(len(self), dtype=np.int32), np.diff(self.offsets))
        return pa.table({MOTION: pa.DictionaryArray.from_arrays(numbers, self.names).cast(pa.string()), **self.columns})

    def number_of(self, motion: float | str | None) -> int:
        """Find the number of a motion; without a number or a name, it is the first one."""
        if isinstance(motion, str) and motion in self.names:
            return self.names.index(motion)
        if isinstance(motion, str) or (motion or 0) >= len(self):
            problem = f"there is no motion {motion if isinstance(motion, str) else int(motion or 0)!r}"
            there = f"the file has {format_count(len(self), 'motion')}: {', '.join(self.names[:5])}"
            raise ConfigError([Problem(f"{problem}; {there}{', ...' if len(self) > 5 else ''}", KEY)])
        return int(motion or 0)

    def ends(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        """Return the positions of each joint at the ``start`` and at the ``end`` of all motions, ``(n_motions,)``."""
        rows = {"start": self.offsets[:-1], "end": self.offsets[1:] - 1}
        columns = list(self.columns.values())[1 : 1 + len(self.joints)]
        return {
            name: {joint: column[row] for joint, column in zip(self.joints, columns, strict=True)}
            for name, row in rows.items()
        }

    def trajectory(self, number: int) -> JointTrajectory:
        """Make the trajectory of a motion.

        Velocities and accelerations that the file does not have are differences of second order, and 0 at both ends.
        """
        times, *columns = (column[self.offsets[number] : self.offsets[number + 1]] for column in self.columns.values())
        count = len(self.joints)
        orders = [np.column_stack(columns[first : first + count]) for first in range(0, len(columns), count)]
        while len(orders) < 3:
            slopes = np.zeros_like(orders[-1])
            if len(times) > 2:
                slopes[1:-1] = np.gradient(orders[-1], times, axis=0)[1:-1]
            orders.append(slopes)
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


def complete(
    family: MotionFile, robot: Robot, *, default: Mapping[str, float], given: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Read a file of motions, and make the keys of a task that follow from it.

    Args:
        family: The section, whose file has an absolute path.
        robot: The robot.
        default: The start of the task for joints that the file does not move.
        given: The keys ``start`` and ``end`` that the user has set.

    Returns:
        ``trajectory``, ``start`` and ``end``, the latter two of the first motion if the user has not set them.
    """
    motions = motions_of(family, robot)
    first = motions.number_of(family.motion)
    chosen = slice(None) if family.motion is None else slice(first, first + 1)
    ends = motions.ends()
    problems = []
    for name, positions in given.items():
        for joint, values in ends[name].items():
            wrong = np.flatnonzero(~(np.abs(values[chosen] - positions.get(joint, np.nan)) <= _SAME))
            if len(wrong):
                number = first + wrong[0]
                sentence = (
                    f"should be {values[number]:.6g}, the {name} of motion {motions.names[number]!r}, or left out"
                )
                problems.append(Problem(f"{sentence}; got {positions.get(joint)}", f"task.{name}.{joint}"))
    problems += [
        Problem("should be left out, as the file does not move this joint", f"task.end.{joint}")
        for joint in given.get("end", {})
        if joint not in motions.joints
    ]
    if problems:
        raise ConfigError(problems)
    keys = {name: {joint: float(values[first]) for joint, values in ends[name].items()} for name in ends}
    return {
        "start": {**default, **keys["start"], **given.get("start", {})},
        "end": {**keys["end"], **given.get("end", {})},
        "trajectory": family.model_copy(update={"sha256": motions.digest}),
    }


def file_trajectory(
    start: Mapping[str, float], end: Mapping[str, float], *, family: MotionFile, robot: Robot
) -> JointTrajectory:
    """Return the points of a motion of a file, which has to lead from the start to the end of the trial."""
    motions = motions_of(family, robot)
    number = motions.number_of(family.motion)
    trajectory = motions.trajectory(number)
    for name, wanted, row in (("start", start, 0), ("end", end, -1)):
        for joint, position in zip(trajectory.joints, trajectory.positions[row].tolist(), strict=True):
            if not abs(position - wanted.get(joint, np.nan)) <= _SAME:
                sentence = f"should be {position:.6g}, the {name} of motion {motions.names[number]!r}"
                raise ConfigError([Problem(f"{sentence}, got {wanted.get(joint)}", f"task.{name}.{joint}")])
    return trajectory


def _make_motions(table: Any, robot: Robot, path: Path) -> Motions:
    """Check a table of points, and put its columns in order."""
    there = [name for name in table.column_names if name not in (MOTION, TIME)]
    joints = tuple(joint for joint in robot.joints if {*columns_of(joint, robot)} & {*there})
    known = [columns_of(joint, robot) for joint in joints]
    orders = max((order + 1 for names in known for order in range(3) if names[order] in there), default=1)
    wanted = [TIME, *(names[order] for order in range(orders) for names in known)]
    problems = [Problem(_explain_column(name, robot), name, path) for name in there if name not in wanted] or [
        Problem("the column is missing", name, path) for name in wanted if name not in table.column_names
    ]
    if len(set(table.column_names)) < len(table.column_names):
        problems.append(Problem("a column is here twice", path=path))
    if problems or not there or not len(table):
        raise ConfigError(problems or [Problem("should have points of joints over time, and has none", path=path)])
    encoded = table[MOTION].cast("string").combine_chunks().dictionary_encode()
    numbers = encoded.indices.to_numpy(zero_copy_only=False)
    starts = np.append(0, np.flatnonzero(np.diff(numbers)) + 1)
    names = [str(encoded.dictionary[number]) for number in numbers[starts].tolist()]
    columns = {name: _read_numbers(table[name], name, path) for name in wanted}
    motions = Motions(tuple(names), joints, np.append(starts, len(table)), columns)
    if problem := next(_find_problems(motions), None):
        raise ConfigError([Problem(problem, path=path)])
    return motions


def _explain_column(name: str, robot: Robot) -> str:
    joint = name if name in robot.joints else name.rpartition("_")[0] or name
    if joint not in robot.joints:
        return unknown_joint(joint, robot)
    return f"should be {', '.join(columns_of(joint, robot)[:2])} or {columns_of(joint, robot)[2]}"


def _read_numbers(column: Any, name: str, path: Path) -> NDArray[np.float64]:
    import pyarrow as pa

    try:
        numbers: NDArray[np.float64] = column.cast(pa.float64()).to_numpy()
    except pa.ArrowException as error:
        raise ConfigError([Problem(f"should be numbers: {error}", name, path)]) from error
    return numbers


def _find_problems(motions: Motions) -> Iterator[str]:
    """Say what is wrong with the numbers of motions, one after the other."""
    times, offsets, names = motions.columns[TIME], motions.offsets, motions.names
    if len(set(names)) < len(names):
        twice = next(name for number, name in enumerate(names) if name in names[:number])
        yield f"the points of motion {twice!r} should follow each other"
    for name, values in motions.columns.items():
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            yield f"{_place(motions, wrong[0])}: {name} should be a number, got {values[wrong[0]]}"
    if len(short := np.flatnonzero(np.diff(offsets) < 2)):
        yield f"motion {names[short[0]]!r}: should have 2 points or more, has 1"
    if len(late := np.flatnonzero(times[offsets[:-1]] != 0)):
        yield f"motion {names[late[0]]!r}: should begin at {TIME} 0, begins at {times[offsets[late[0]]]:g}"
    falling = np.diff(times) <= 0
    # The times of each motion begin at 0 again.
    falling[offsets[1:-1] - 1] = False
    if len(wrong := np.flatnonzero(falling)):
        row = wrong[0] + 1
        yield f"{_place(motions, row)}: {TIME} should rise, is {times[row]:g} after {times[row - 1]:g}"
    at_rest = np.append(offsets[:-1], offsets[1:] - 1)
    for name, values in list(motions.columns.items())[1 + len(motions.joints) :]:
        if len(wrong := np.flatnonzero(np.abs(values[at_rest]) > _SAME)):
            row = at_rest[wrong[0]]
            yield f"{_place(motions, row)}: {name} should be 0, as motions begin and end at rest, got {values[row]:g}"


def _place(motions: Motions, row: int) -> str:
    number = int(np.searchsorted(motions.offsets, row, side="right")) - 1
    return f"motion {motions.names[number]!r}, point {row - motions.offsets[number] + 1}"
