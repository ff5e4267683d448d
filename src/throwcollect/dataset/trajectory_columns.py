"""Columns of trajectories: their names, those of their components, and arrays filled from recordings."""

from __future__ import annotations

import math
import mmap
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.mcap_reader import EpisodePlace, open_mcap
from throwcollect.episode.message_table import MessageTable, read_column
from throwcollect.episode.topics import rotate
from throwcollect.errors import DatasetError
from throwcollect.units import NS_PER_S, name_sliding

TIMES = "time_s"
STAMPS = "stamps_ns"
ATTRIBUTES = {
    STAMPS: "stamps_ns",
    "joints_position": "position",
    "joints_velocity": "velocity",
    "joints_effort": "effort",
    "ball_position": "ball_position",
    "ball_orientation_xyzw": "ball_orientation_xyzw",
    "ball_velocity": "ball_linear_velocity",
    "ball_angular_velocity": "ball_angular_velocity",
}
"""The attribute of `Samples` that each recorded column has."""
COLUMNS = (TIMES, *ATTRIBUTES)
"""All columns of a trajectory; ``docs/reading.md`` describes them."""
JOINT_COLUMNS, BALL_COLUMNS = COLUMNS[2:5], COLUMNS[5:]
_ORIENTATION, *_VELOCITIES = COLUMNS[6:]

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
    widths = dict.fromkeys(JOINT_COLUMNS, joints) | {name: len(name_components(name, ())) for name in BALL_COLUMNS}
    shapes = {name: (samples, widths[name]) if name in widths else (samples,) for name in columns}
    return {name: _make_empty(shape, np.int64 if name == STAMPS else np.float64) for name, shape in shapes.items()}


def _make_empty(shape: tuple[int, ...], dtype: type[np.generic]) -> Column:
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < _LARGE_BYTES:
        return np.empty(shape, dtype)
    # NumPy asks the kernel for huge pages. A virtual machine whose host takes back free memory gets these piece by
    # piece, which can take several times as long as everything else here, so the memory is mapped without them.
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(memory, dtype).reshape(shape)


def fill(
    columns: Mapping[str, Column], places: Sequence[EpisodePlace], known: tuple[str, ...], joints: tuple[str, ...]
) -> None:
    """Fill columns with those of some throws, one after the other.

    Args:
        columns: Arrays with as many rows as the throws have samples, by name, as `empty_columns` makes them.
        places: The throws.
        known: Joints that are recorded.
        joints: Joints that the columns of joints have; some of those that are recorded.
    """
    velocities = [name for name in _VELOCITIES if name in columns]
    # Velocities in world follow from the orientation, so it is read even if nobody asks for it.
    needed = {_ORIENTATION} - columns.keys() if velocities else ()
    recorded = {**columns, **empty_columns(needed, sum(place.samples for place in places), 0)}
    stamped = {STAMPS, TIMES} & columns.keys()
    some = [] if joints == known else [name for name in JOINT_COLUMNS if name in columns]
    whole = [
        (_view_as_bytes(column), ATTRIBUTES[name]) for name, column in recorded.items() if name not in {*stamped, *some}
    ]
    indexes = np.array([known.index(joint) for joint in joints], np.intp)
    filled = 0
    for path, group in groupby(places, attrgetter("path")):
        with open_mcap(path) as contents:
            for place in group:
                span = slice(filled, filled := filled + place.samples)
                try:
                    chunk = contents.chunk(place.offset)
                    place.check_start(chunk)
                    rows = MessageTable(chunk.decompress(), place.samples).rows(known)
                except DatasetError as error:
                    raise error.locate(path, f"byte {place.offset}") from error
                for target, name in whole:
                    target[span] = rows[name]
                for name in some:
                    every = read_column(rows, ATTRIBUTES[name])
                    # With the default mode, NumPy would write to a buffer first; all indexes are valid.
                    np.take(every, indexes, axis=1, out=columns[name][span], mode="clip")
                if stamped:
                    stamps = read_column(rows, STAMPS)
                    values = {STAMPS: stamps, TIMES: (stamps - place.start_ns) / NS_PER_S}
                    for name in stamped:
                        columns[name][span] = values[name]
                del rows, chunk  # the next ones then take their place in the caches
    if velocities:
        turned = rotate(recorded[_ORIENTATION], *(columns[name] for name in velocities), inverse=False)
        for name, values in zip(velocities, turned, strict=True):
            columns[name][:] = values


def _view_as_bytes(array: Column) -> NDArray[np.void]:
    """View a contiguous array of two dimensions as one run of bytes per row, shape ``(n,)``."""
    rows: NDArray[np.void] = array.view(f"V{array.shape[1] * array.itemsize}")[:, 0]
    return rows
