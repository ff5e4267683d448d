"""Trajectories of many throws in arrays: one array for each column, throws one after the other."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.mcap_reader import EpisodePlace, open_mcap
from throwcollect.episode.message_table import list_body_fields, read_column
from throwcollect.episode.topics import STAMP, read_stamps, rotate
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.units import NS_PER_S, name_sliding
from throwcollect.wording import format_count, suggest

TIMES = "time_s"
STAMPS = "stamps_ns"
JOINT_COLUMNS = {"joints_position": "position", "joints_velocity": "velocity", "joints_effort": "effort"}
"""Columns of joints, and the fields of `MessageTable.rows` that they are read from."""

_JOINT_COMPONENTS = {"position": "position_rad", "velocity": "velocity_radps", "effort": "effort_nm"}
_BODY_QUANTITIES = {
    "position": "position",
    "orientation_xyzw": "orientation_xyzw",
    "velocity": "linear_velocity",
    "angular_velocity": "angular_velocity",
}
"""Quantities in columns of bodies, and what of a body they are read from (`BODY_FIELDS`)."""
BODY_COMPONENTS = {
    "position": ("x_m", "y_m", "z_m"),
    "orientation_xyzw": ("qx", "qy", "qz", "qw"),
    "velocity": ("vx_mps", "vy_mps", "vz_mps"),
    "angular_velocity": ("wx_radps", "wy_radps", "wz_radps"),
}

Column = NDArray[Any]
"""float64, or int64 for stamps."""

_ORIENTATION = "orientation_xyzw"

_BLOCK = 16
"""Throws that are read at once: enough to be worth an array, few enough for the caches."""
_MOST_THREADS = 4
"""More are of no use, as part of the work holds the lock of the interpreter."""


def name_components(column: str, joints: Sequence[str], sliding: Collection[str] = ()) -> tuple[str, ...]:
    """Name the components of a column, with units, for a table in which each has a column of its own.

    The column is one of `JOINT_COLUMNS`, which have the joints `joints`, of which some may be `sliding`.
    """
    names = {joint: f"{joint}_{_JOINT_COMPONENTS[JOINT_COLUMNS[column]]}" for joint in joints}
    return tuple(name_sliding(name) if joint in sliding else name for joint, name in names.items())


def list_columns(bodies: Sequence[str]) -> dict[str, str]:
    """List the columns of trajectories in which these bodies move, with the fields of rows that they are read from.

    ``docs/dataset.md`` describes them.
    """
    columns = {TIMES: STAMPS, STAMPS: STAMPS, **JOINT_COLUMNS}
    for number, name in enumerate(bodies):
        fields = list_body_fields(number)
        columns |= {f"{name}_{quantity}": fields[part] for quantity, part in _BODY_QUANTITIES.items()}
    return columns


@dataclass(frozen=True, eq=False, repr=False)
class Trajectories:
    """Trajectories of many throws, one after the other.

    ``trajectories["ball_position"]`` is the column of all throws, ``trajectories[i]`` all columns of one, as views.

    Attributes:
        trials: Numbers of the trials, shape ``(n_throws,)``.
        offsets: Throw i has the samples from ``offsets[i]`` to ``offsets[i + 1]``, not included; shape
            ``(n_throws + 1,)``. A trial without an episode has none.
        columns: Arrays of shape ``(n_samples,)`` or ``(n_samples, n)``, by name.
        joints: Names of the joints that the columns of joints have.
    """

    trials: NDArray[np.int64]
    offsets: NDArray[np.int64]
    columns: Mapping[str, Column]
    joints: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.trials)

    def __repr__(self) -> str:
        size = sum(column.nbytes for column in self.columns.values()) / 1e6
        names = ", ".join(self.columns)
        return f"Trajectories({format_count(len(self), 'throw')}, {self.offsets[-1]} samples, {size:.1f} MB: {names})"

    def __iter__(self) -> Iterator[dict[str, Column]]:
        return (self[number] for number in range(len(self)))

    @overload
    def __getitem__(self, which: str) -> Column: ...
    @overload
    def __getitem__(self, which: int) -> dict[str, Column]: ...
    def __getitem__(self, which: str | int) -> Column | dict[str, Column]:
        """Return a column of all throws by its name, or all columns of one throw by its position.

        Raises:
            KeyError: If the column was not read.
            IndexError: If there is no throw at this position.
            TypeError: If it is neither.
        """
        if isinstance(which, str):
            return self.columns[which]
        number = range(len(self))[which]
        rows = slice(self.offsets[number], self.offsets[number + 1])
        return {name: column[rows] for name, column in self.columns.items()}

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Number of samples of each throw, shape ``(n_throws,)``."""
        return np.diff(self.offsets)

    def padded(self, column: str, *, fill: float = np.nan) -> NDArray[np.float64]:
        """Copy a column into one shape for all throws: the samples of each, then `fill` up to the longest throw.

        Stamps become floating point numbers, which are off by up to some hundred nanoseconds.

        Returns:
            Shape ``(n_throws, n_longest)`` or ``(n_throws, n_longest, n)``.

        Raises:
            KeyError: If the column was not read.
        """
        values, lengths = self[column], self.lengths
        longest = int(lengths.max(initial=0))
        padded = np.full((len(self), longest, *values.shape[1:]), fill)
        # The chosen places are filled row by row, and in this order the samples lie in `values`.
        padded[np.arange(longest) < lengths[:, np.newaxis]] = values
        return padded


def read_trajectories(
    trials: Sequence[int],
    places: Sequence[EpisodePlace | None],
    columns: Sequence[str],
    known: tuple[str, ...],
    bodies: tuple[str, ...],
    joints: tuple[str, ...],
    *,
    threads: int | None = None,
) -> Trajectories:
    """Read the trajectories of trials, whose episodes lie at these places; None for a trial that has none.

    `known` are the joints, and `bodies` the bodies that are recorded, with the object first; the other arguments are
    those of `Dataset.trajectories`.
    """
    there = list_columns(bodies)
    for column in columns:
        if column not in there:
            raise ConfigError(f"a trajectory has no column {column!r}{suggest(column, there, 'docs/dataset.md')}")
    stored = [place for place in places if place is not None]
    offsets = np.zeros(len(places) + 1, np.int64)
    np.cumsum([place.samples if place else 0 for place in places], out=offsets[1:])
    found = {name: _make_column(name, int(offsets[-1]), len(joints)) for name in columns}
    blocks = [stored[first : first + _BLOCK] for first in range(0, len(stored), _BLOCK)]
    starts = np.cumsum([0, *(sum(place.samples for place in block) for block in blocks)]).tolist()

    def read(block: Sequence[EpisodePlace], start: int, stop: int) -> None:
        _fill({name: column[start:stop] for name, column in found.items()}, block, known, bodies, joints)

    threads = threads or min(_MOST_THREADS, os.cpu_count() or 1)
    with nullcontext() if threads == 1 else ThreadPoolExecutor(threads) as pool:
        # Decompressing and copying release the lock of the interpreter.
        for _ in (pool.map if pool else map)(read, blocks, starts[:-1], starts[1:]):
            pass
    return Trajectories(np.array(trials, np.int64), offsets, found, joints)


def _make_column(name: str, samples: int, joints: int) -> Column:
    """Make the array of a column, shape ``(samples,)`` or ``(samples, n)``; columns of joints have so many joints."""
    if name in (TIMES, STAMPS):
        return np.empty(samples, np.int64 if name == STAMPS else np.float64)
    width = joints if name in JOINT_COLUMNS else 4 if name.endswith(_ORIENTATION) else 3
    return np.empty((samples, width))


def _fill(
    columns: Mapping[str, Column],
    places: Sequence[EpisodePlace],
    known: tuple[str, ...],
    bodies: tuple[str, ...],
    joints: tuple[str, ...],
) -> None:
    """Fill columns with those of some throws, one after the other.

    Args:
        columns: Arrays with as many rows as the throws have samples, by name, as `_make_column` makes them.
        places: The throws.
        known: Joints that are recorded.
        bodies: Bodies that are recorded, with the object first.
        joints: Joints that the columns of joints have; some of those that are recorded.
    """
    fields = list_columns(bodies)
    velocities = {
        f"{body}_{_ORIENTATION}": [name for name in (f"{body}_velocity", f"{body}_angular_velocity") if name in columns]
        for body in bodies
    }
    # Velocities in world follow from orientations, and times from stamps, so these are always read with them.
    sources = {**velocities, STAMPS: [name for name in (STAMPS, TIMES) if name in columns]}
    missing = {name for name, derived in sources.items() if derived} - columns.keys()
    count = sum(place.samples for place in places)
    copied = {**columns, **{name: _make_column(name, count, 0) for name in missing}}
    some = [] if joints == known else [name for name in JOINT_COLUMNS if name in columns]
    # Rows of whole columns are copied as runs of bytes.
    whole = [
        (column.reshape(len(column), -1).view(f"V{column.strides[0]}")[:, 0], fields[name])
        for name, column in copied.items()
        if name not in {TIMES, *some}
    ]
    indexes = np.array([known.index(joint) for joint in joints], np.intp)
    filled = 0
    for path, group in groupby(places, attrgetter("path")):
        with open_mcap(path) as contents:
            for place in group:
                span = slice(filled, filled := filled + place.samples)
                try:
                    rows = place.read_rows(contents, known)
                except DatasetError as error:
                    raise error.locate(path, f"byte {place.offset}") from error
                for target, name in whole:
                    target[span] = rows[name]
                for name in some:
                    every = read_column(rows, fields[name])
                    # With the default mode, NumPy would write to a buffer first; all indexes are valid.
                    np.take(every, indexes, axis=1, out=columns[name][span], mode="clip")
                del rows  # the next ones then take their place in the caches
    if sources[STAMPS]:
        stamps = copied[STAMPS]
        stamps[:] = read_stamps(stamps.view(STAMP), "stamp")
        if TIMES in columns:
            starts, lengths = zip(*((place.start_ns, place.samples) for place in places), strict=True)
            np.divide(stamps - np.repeat(starts, lengths), NS_PER_S, out=columns[TIMES])
    for orientation, names in velocities.items():
        if names:
            turned = rotate(copied[orientation], *(columns[name] for name in names), inverse=False)
            for name, values in zip(names, turned, strict=True):
                columns[name][:] = values
