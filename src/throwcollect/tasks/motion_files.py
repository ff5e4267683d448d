"""Reads files of motions of all kinds into one table: a row for each point, with the motion that it belongs to."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.motion import MotionFile
from throwcollect.episode.trajectory_messages import read_trajectory_messages
from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import lazily
from throwcollect.files import suggest_path
from throwcollect.robots.robot import Robot
from throwcollect.units import name_sliding

h5py = lazily("h5py")

MOTION, TIME = "motion", "time_s"
"""Columns of the name of a point's motion, and of the time since the motion's start."""
_FILE, _JOINTS, _RATE = "task.trajectory.file", "task.trajectory.joints", "task.trajectory.rate_hz"
_KINDS = "a .csv, .parquet, .npz, .hdf5, .h5 or .mcap file, a directory of .csv or .hdf5 files, or a LeRobot dataset"


class _Motion(NamedTuple):
    """One motion of a file of arrays: its name, times, and positions, possibly with their derivatives, by column."""

    name: str
    times: NDArray[np.float64]
    orders: Sequence[NDArray[np.float64]]


def columns_of(joint: str, robot: Robot) -> tuple[str, str, str]:
    """Name the columns of a joint's position, velocity and acceleration, with their units."""
    position, velocity, acceleration = (f"{joint}{suffix}" for suffix in ("_rad", "_radps", "_radps2"))
    if joint in robot.sliding:
        return name_sliding(position), name_sliding(velocity), name_sliding(acceleration)
    return position, velocity, acceleration


def read_motion_table(family: MotionFile, robot: Robot) -> Any:
    """Read the Arrow table of all points of a file: `MOTION`, `TIME`, and columns of joints, unchecked."""
    import pyarrow as pa

    path = Path(family.file)
    try:
        if not path.exists():
            raise ConfigError([Problem(f"there is no file {path}{'' if family.sha256 else suggest_path(path)}", _FILE)])
        if not path.is_dir():
            files = [path]
        elif (path / "meta" / "info.json").is_file():
            return _read_lerobot(path, family, robot)
        else:
            files = sorted((each for each in path.iterdir() if each.suffix in (".csv", ".hdf5", ".h5")), key=_by_number)
        if not files or files[0].suffix not in _READERS:
            raise ConfigError([Problem(f"should be {_KINDS}, got {path}", _FILE)])
        return pa.concat_tables(_READERS[each.suffix](each, family, robot) for each in files)
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        raise ConfigError([Problem(f"cannot be read: {str(error).partition(chr(10))[0]}", _FILE, path)]) from error


def _by_number(path: Path) -> list[str | int]:
    """Sort ``episode_10`` behind ``episode_9``."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", path.stem)]


def _read_csv(path: Path, _family: MotionFile, _robot: Robot) -> Any:
    import pyarrow as pa
    from pyarrow import csv

    table = csv.read_csv(path, convert_options=csv.ConvertOptions(column_types={MOTION: pa.string()}))
    return _name_motion(table.rename_columns([name.strip() for name in table.column_names]), path)


def _read_parquet(path: Path, _family: MotionFile, _robot: Robot) -> Any:
    import pyarrow.parquet as pq

    return _name_motion(pq.ParquetFile(path).read(), path)


def _name_motion(table: Any, path: Path) -> Any:
    """Give points without the name of a motion that of their file."""
    import pyarrow as pa

    if MOTION in table.column_names:
        return table
    return table.append_column(MOTION, pa.repeat(pa.scalar(path.stem), len(table)))


def _read_npz(path: Path, _family: MotionFile, robot: Robot) -> Any:
    with np.load(path) as archive:
        orders = [
            archive[name] for name in ("position_rad", "velocity_radps", "acceleration_radps2") if name in archive
        ]
        count, points, _ = orders[0].shape if orders else (0, 0, 0)
        lengths = archive["length"].tolist() if "length" in archive else [points] * count
        times, joints = np.broadcast_to(archive[TIME], (count, points)), archive["joints"].tolist()
    motions = (
        _Motion(str(number), times[number, :length], [order[number, :length] for order in orders])
        for number, length in enumerate(lengths)
    )
    return _tabulate(motions, joints, robot, path)


def _read_hdf5(path: Path, family: MotionFile, robot: Robot) -> Any:
    with h5py.File(path) as file:
        if "data" in file:
            demos = sorted(file["data"], key=lambda name: _by_number(Path(name)))
            actions = {name: file[f"data/{name}/actions"][:] for name in demos}
        else:
            actions = {path.stem: file["action"][:]}
        rate_hz = family.rate_hz or file.attrs.get("rate_hz")
    if rate_hz is None or not family.joints:
        key, what = (_RATE, "how many points a second") if rate_hz is None else (_JOINTS, "which joints")
        raise ConfigError([Problem(f"missing; {path.name} does not say {what} it has", key)])
    motions = (_Motion(name, np.arange(len(values)) / rate_hz, [values]) for name, values in actions.items())
    return _tabulate(motions, family.joints, robot, path)


def _read_lerobot(path: Path, family: MotionFile, robot: Robot) -> Any:
    import pyarrow.parquet as pq

    info = json.loads((path / "meta" / "info.json").read_text(encoding="utf-8"))
    names = info["features"]["action"]["names"]
    # Older datasets have the names below a word such as `motors`.
    names = next(iter(names.values())) if isinstance(names, dict) else names
    files = sorted((path / "data").rglob("*.parquet"))
    parts = [pq.ParquetFile(file).read(["episode_index", "action"]) for file in files]
    episodes = np.concatenate([part["episode_index"].to_numpy() for part in parts])
    actions = np.concatenate([np.stack(part["action"].to_numpy()) for part in parts])
    starts = np.append(0, np.flatnonzero(np.diff(episodes)) + 1)
    motions = (
        _Motion(str(episodes[start]), np.arange(len(rows)) / (family.rate_hz or info["fps"]), [rows])
        for start, rows in zip(starts, np.split(actions, starts[1:]), strict=True)
    )
    return _tabulate(motions, family.joints or [name.removesuffix(".pos") for name in names], robot, path)


def _read_mcap(path: Path, _family: MotionFile, robot: Robot) -> Any:
    tables = []
    for number, message in enumerate(read_trajectory_messages(path)):
        motion = _Motion(str(number), message.times, message.orders)
        tables.append(_tabulate(iter([motion]), message.joints, robot, path))
    if not tables:
        raise ConfigError([Problem("has no message of trajectory_msgs/msg/JointTrajectory", path=path)])
    if any({*each.column_names} != {*tables[0].column_names} for each in tables):
        raise ConfigError([Problem("its messages should have the same joints and derivatives", path=path)])
    import pyarrow as pa

    return pa.concat_tables(each.select(tables[0].column_names) for each in tables)


def _tabulate(motions: Iterator[_Motion], joints: Sequence[str | None], robot: Robot, path: Path) -> Any:
    """Make the table of motions whose columns are those of some joints; those of None are left out."""
    import pyarrow as pa

    names, times, orders = zip(*motions, strict=True)
    blocks = [np.concatenate(each) for each in zip(*orders, strict=True)]
    if any(block.ndim != 2 or block.shape[1] != len(joints) for block in blocks):
        raise ConfigError([Problem(f"there are {blocks[0].shape[-1]} columns, got {len(joints)}", _JOINTS, path)])
    numbers = np.repeat(np.arange(len(names), dtype=np.int32), [len(each) for each in times])
    columns: dict[str, Any] = {
        MOTION: pa.DictionaryArray.from_arrays(numbers, names).cast(pa.string()),
        TIME: np.concatenate(times),
    }
    for column, joint in enumerate(joints):
        for name, block in zip(columns_of(joint, robot) if joint else (), blocks, strict=False):
            columns[name] = np.ascontiguousarray(block[:, column], dtype=np.float64)
    return pa.table(columns)


_READERS: Mapping[str, Callable[[Path, MotionFile, Robot], Any]] = MappingProxyType(
    {
        ".csv": _read_csv,
        ".parquet": _read_parquet,
        ".npz": _read_npz,
        ".hdf5": _read_hdf5,
        ".h5": _read_hdf5,
        ".mcap": _read_mcap,
    }
)
