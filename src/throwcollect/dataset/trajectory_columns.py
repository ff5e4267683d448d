"""Columns of trajectories: their names, the places of their throws in files, and arrays filled from there."""

from __future__ import annotations

import math
import mmap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.mcap_reader import McapContents, open_mcap
from throwcollect.episode.chunk import CHUNK_HEADER_BYTES, Chunk
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.topics import rotate
from throwcollect.episode.trajectory_rows import (
    BALL_ORIENTATION,
    BALL_VELOCITIES,
    JOINT_COLUMNS,
    STAMPS,
    column_shapes,
    to_nanoseconds,
    trajectory_rows,
    view_as_bytes,
)
from throwcollect.errors import DatasetError
from throwcollect.units import NS_PER_S, name_sliding

TIMES = "time_s"
BALL_COLUMNS = ("ball_position", BALL_ORIENTATION, *BALL_VELOCITIES)
COLUMNS = (TIMES, STAMPS, *JOINT_COLUMNS, *BALL_COLUMNS)
"""All columns of a trajectory; ``docs/reading.md`` describes them."""

_JOINT_COMPONENTS = {"position": "position_rad", "velocity": "velocity_radps", "effort": "effort_nm"}
_BALL_COMPONENTS = {
    "position": ("x_m", "y_m", "z_m"),
    "orientation_xyzw": ("qx", "qy", "qz", "qw"),
    "velocity": ("vx_mps", "vy_mps", "vz_mps"),
    "angular_velocity": ("wx_radps", "wy_radps", "wz_radps"),
}

Column = NDArray[Any]
"""float64, or int64 for stamps."""

_LARGE_BYTES = 4 << 20


@dataclass(frozen=True)
class StoredThrow:
    """The episode of a throw in an MCAP file, whose chunk begins at `offset` [bytes].

    Attributes:
        start_ns: Simulated time at which the trial starts [ns].
        samples: Number of samples.
        joints: Joints that are recorded, in the order of their columns.
    """

    trial: int
    start_ns: int
    path: Path
    offset: int
    samples: int
    joints: tuple[str, ...]

    def read(self) -> Episode:
        """Read the episode from its file."""
        with open_mcap(self.path) as contents:
            try:
                episode = contents.episode(contents.record(self.offset)).episode
            except DatasetError as error:
                raise error.locate(self.path) from error
        if (found := episode.header.trial) != self.trial:
            expected = f"trial {self.trial}"
            raise DatasetError(f"trial {found}", path=self.path, place=f"byte {self.offset}", expected=expected)
        return episode

    def read_rows(self) -> NDArray[np.void]:
        """Read the rows of its samples from its file; see `trajectory_rows`."""
        (rows,) = read_stored_rows([self])
        return rows


def name_components(column: str, joints: Sequence[str], sliding: Collection[str] = ()) -> tuple[str, ...]:
    """Name the components of a column, with units, for a table in which each has a column of its own.

    The column is any of `COLUMNS` but times and stamps. A column of joints has the joints `joints`, of
    which some may be `sliding`.
    """
    series, _, quantity = column.partition("_")
    if series == "joints":
        names = {joint: f"{joint}_{_JOINT_COMPONENTS[quantity]}" for joint in joints}
        return tuple(name_sliding(name) if joint in sliding else name for joint, name in names.items())
    return tuple(f"ball_{component}" for component in _BALL_COMPONENTS[quantity])


def empty_columns(columns: Iterable[str], samples: int, joints: int) -> dict[str, Column]:
    """Make arrays for some of `COLUMNS`, by name; shape ``(samples,)`` or ``(samples, n)``.

    `joints` is the number of joints that the columns of joints have.
    """
    shapes = {TIMES: (samples,), **column_shapes(samples, joints)}
    return {name: _make_empty(shapes[name], np.int64 if name == STAMPS else np.float64) for name in columns}


def _make_empty(shape: tuple[int, ...], dtype: type[np.generic]) -> Column:
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < _LARGE_BYTES:
        return np.empty(shape, dtype)
    # NumPy asks the kernel for huge pages. A virtual machine whose host takes back free memory gets these piece by
    # piece, which can take several times as long as everything else here, so the memory is mapped without them.
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(memory, dtype).reshape(shape)


def read_stored_rows(throws: Iterable[StoredThrow]) -> Iterator[NDArray[np.void]]:
    """Read the rows of episodes, one after the other; each file is open while its throws follow each other."""
    for path, group in groupby(throws, attrgetter("path")):
        with open_mcap(path) as contents:
            for place in group:
                yield _read_rows(place, contents)


def _read_rows(place: StoredThrow, contents: McapContents) -> NDArray[np.void]:
    offset = place.offset
    try:
        size = Chunk.read_announced_size(contents.slice(offset, offset + CHUNK_HEADER_BYTES))
        chunk = Chunk.parse(contents.slice(offset, offset + size))
        if chunk.start_ns != place.start_ns:
            raise DatasetError(f"starts at {chunk.start_ns} ns", expected=f"trial {place.trial} at {place.start_ns} ns")
        return trajectory_rows(chunk.decompress(), place.samples, place.joints)
    except DatasetError as error:
        raise error.locate(place.path, f"byte {offset}") from error


def fill(
    columns: Mapping[str, Column],
    throws: Sequence[tuple[int, int]],
    tables: Iterable[NDArray[np.void]],
    known: tuple[str, ...],
    joints: tuple[str, ...],
) -> None:
    """Fill columns with those of some throws, one after the other.

    Args:
        columns: Arrays with as many rows as the throws have samples, by name, as `empty_columns` makes them.
        throws: Start [ns] and number of samples of each, at least one.
        tables: Their rows, as `read_stored_rows` gives them.
        known: Joints that are recorded.
        joints: Joints that the columns of joints have; some of those that are recorded.
    """
    # Times follow from stamps, and velocities in world from orientations, so these are read even if nobody asks.
    starts_ns, lengths = zip(*throws, strict=True)
    velocities = [name for name in BALL_VELOCITIES if name in columns]
    needed = {TIMES: STAMPS, **dict.fromkeys(velocities, BALL_ORIENTATION)}
    missing = {source for name, source in needed.items() if name in columns} - columns.keys()
    recorded = {**columns, **empty_columns(missing, sum(lengths), len(known))}
    # Whole columns are copied as bytes. Columns of only some joints are copied to `every`, from which `take` picks
    # them.
    chosen = [] if joints == known else [name for name in JOINT_COLUMNS if name in columns]
    targets = [(view_as_bytes(recorded[name]), name) for name in recorded if name != TIMES and name not in chosen]
    indexes = np.array([known.index(joint) for joint in joints], np.intp)
    every = np.empty((max(lengths), len(known)))
    filled = 0
    for rows in tables:
        span = slice(filled, filled + len(rows))
        for target, name in targets:
            target[span] = rows[name]
        for name in chosen:
            view_as_bytes(every)[: len(rows)] = rows[name]
            # With the default mode, NumPy would write to a buffer first. All indexes are valid, so nothing is clipped.
            np.take(every[: len(rows)], indexes, axis=1, out=columns[name][span], mode="clip")
        filled += len(rows)
        del rows  # the next ones then take its place in the caches
    _derive(columns, recorded, velocities, np.repeat(starts_ns, lengths))


def _derive(
    columns: Mapping[str, Column], recorded: Mapping[str, Column], velocities: Sequence[str], starts: NDArray[np.int64]
) -> None:
    """Turn stamps into nanoseconds, and compute times and the velocities in world from the recorded columns."""
    if STAMPS in recorded:
        to_nanoseconds(recorded[STAMPS])
    if TIMES in columns:
        np.divide(recorded[STAMPS] - starts, NS_PER_S, out=columns[TIMES])
    if velocities:
        turned = rotate(recorded[BALL_ORIENTATION], *(columns[name] for name in velocities), inverse=False)
        for name, values in zip(velocities, turned, strict=True):
            columns[name][:] = values
