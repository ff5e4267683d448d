"""Reads files of motions of all kinds into one table: a row for each point, with the motion that it belongs to."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
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
# Simulations read no files of motions, and should not load these.
pa, pc, pq = lazily("pyarrow"), lazily("pyarrow.csv"), lazily("pyarrow.parquet")

MOTION, TIME = "motion", "time_s"
"""Columns of the name of a point's motion, and of the time since the motion's start."""
_FILE = "task.trajectory.file"
_KINDS = "a .csv, .parquet, .npz, .hdf5, .h5 or .mcap file, a directory of such files, or a LeRobot dataset"


class _Motion(NamedTuple):
    """One motion of a file of arrays: its name, times, and positions, possibly with derivatives, ``(n_points, n)``."""

    name: str
    times: NDArray[np.float64]
    orders: Sequence[NDArray[np.float64]]


_Arrays = tuple[Sequence[str | None], list[_Motion]]
"""Joints of the columns, without those that are left out, and the motions."""


def columns_of(joint: str, robot: Robot) -> list[str]:
    """Name the columns of a joint's position, velocity and acceleration, with their units."""
    names = [f"{joint}{suffix}" for suffix in ("_rad", "_radps", "_radps2")]
    return [*map(name_sliding, names)] if joint in robot.sliding else names


def read_motion_table(family: MotionFile, robot: Robot) -> Any:
    """Read the Arrow table of all points of a file: `MOTION`, `TIME`, and columns of joints, unchecked."""
    path = Path(family.file)
    try:
        if not path.exists():
            near = "" if family.sha256 else suggest_path(path)
            raise ConfigError([Problem(f"there is no file {path}{near}", _FILE)])
        found: list[Any] = []
        if (path / "meta" / "info.json").is_file():
            found.append(_read_lerobot(path, family))
        else:
            files = sorted(path.iterdir(), key=_by_number) if path.is_dir() else [path]
            found += [_READERS[file.suffix](file, family) for file in files if file.suffix in _READERS]
        if not found:
            raise ConfigError([Problem(f"should be {_KINDS}, got {path}", _FILE)])
        return pa.concat_tables(
            each if isinstance(each, pa.Table) else _tabulate(each[0], each[1], robot) for each in found
        )
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        raise ConfigError([Problem(f"cannot be read: {str(error).partition(chr(10))[0]}", _FILE, path)]) from error


def _by_number(path: Path) -> list[str | int]:
    """Sort ``episode_10`` behind ``episode_9``."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", path.stem)]


def _read_table(path: Path, _family: MotionFile) -> Any:
    """Read a table of CSV or Parquet; a motion without a name gets that of the file."""
    if path.suffix == ".csv":
        table = pc.read_csv(path, convert_options=pc.ConvertOptions(column_types={MOTION: pa.string()}))
        table = table.rename_columns([name.strip() for name in table.column_names])
    else:
        table = pq.ParquetFile(path).read()
    if MOTION in table.column_names:
        return table
    return table.append_column(MOTION, pa.repeat(pa.scalar(path.stem), len(table)))


def _read_npz(path: Path, _family: MotionFile) -> _Arrays:
    with np.load(path) as archive:
        orders = [
            archive[name] for name in ("position_rad", "velocity_radps", "acceleration_radps2") if name in archive
        ]
        count, points, _ = orders[0].shape
        lengths = archive["length"].tolist() if "length" in archive else [points] * count
        times = np.broadcast_to(archive[TIME], (count, points))
        return archive["joints"].tolist(), [
            _Motion(str(number), times[number, :length], [order[number, :length] for order in orders])
            for number, length in enumerate(lengths)
        ]


def _read_hdf5(path: Path, family: MotionFile) -> _Arrays:
    with h5py.File(path) as file:
        demos = sorted(file.get("data", ()), key=lambda name: _by_number(Path(name)))
        places = {name: f"data/{name}/actions" for name in demos} or {path.stem: "action"}
        rate_hz = family.rate_hz or file.attrs.get("rate_hz")
        for key, value in (("rate_hz", rate_hz), ("joints", family.joints)):
            if not value:
                raise ConfigError([Problem(f"missing; {path.name} does not have it", f"task.trajectory.{key}")])
        actions = {name: file[place][:] for name, place in places.items()}
    return family.joints, [_Motion(name, np.arange(len(rows)) / rate_hz, [rows]) for name, rows in actions.items()]


def _read_lerobot(path: Path, family: MotionFile) -> _Arrays:
    info = json.loads((path / "meta" / "info.json").read_text(encoding="utf-8"))
    names = info["features"]["action"]["names"]
    # Older datasets have the names below a word such as `motors`.
    names = next(iter(names.values())) if isinstance(names, dict) else names
    files = sorted((path / "data").rglob("*.parquet"))
    parts = [pq.ParquetFile(file).read(["episode_index", "action"]) for file in files]
    episodes = np.concatenate([part["episode_index"].to_numpy() for part in parts])
    actions = np.concatenate([np.stack(part["action"].to_numpy()) for part in parts])
    starts = np.append(0, np.flatnonzero(np.diff(episodes)) + 1)
    rate_hz = family.rate_hz or info["fps"]
    return family.joints or [name.removesuffix(".pos") for name in names], [
        _Motion(str(episodes[start]), np.arange(len(rows)) / rate_hz, [rows])
        for start, rows in zip(starts, np.split(actions, starts[1:]), strict=True)
    ]


def _read_mcap(path: Path, _family: MotionFile) -> _Arrays:
    messages = list(read_trajectory_messages(path))
    if not messages or any(message.joints != messages[0].joints for message in messages):
        raise ValueError("should have messages of trajectory_msgs/msg/JointTrajectory, all with the same joints")
    return messages[0].joints, [_Motion(str(n), each.times, each.orders) for n, each in enumerate(messages)]


def _tabulate(joints: Sequence[str | None], motions: list[_Motion], robot: Robot) -> Any:
    names, times, orders = zip(*motions, strict=True)
    blocks = [np.concatenate(each) for each in zip(*orders, strict=True)]
    if any(block.shape[1:] != (len(joints),) for block in blocks):
        problem = f"should name {blocks[0].shape[-1]} columns, names {len(joints)}"
        raise ConfigError([Problem(problem, "task.trajectory.joints")])
    columns: dict[str, Any] = {
        MOTION: pa.DictionaryArray.from_arrays(np.repeat(np.arange(len(names)), [*map(len, times)]), names),
        TIME: np.concatenate(times),
    }
    for column, joint in enumerate(joints):
        for name, block in zip(columns_of(joint, robot) if joint else (), blocks, strict=False):
            columns[name] = np.ascontiguousarray(block[:, column], dtype=np.float64)
    return pa.table(columns)


_READERS = MappingProxyType[str, Callable[[Path, MotionFile], Any]](
    {
        **dict.fromkeys((".csv", ".parquet"), _read_table),
        **dict.fromkeys((".hdf5", ".h5"), _read_hdf5),
        ".npz": _read_npz,
        ".mcap": _read_mcap,
    }
)
