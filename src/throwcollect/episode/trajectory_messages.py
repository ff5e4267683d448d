"""Reads the joint trajectories of an MCAP file of ROS 2, whoever wrote it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.units import NS_PER_S

_TYPE = "trajectory_msgs/msg/JointTrajectory"


class TrajectoryMessage(NamedTuple):
    """The contents of a message: joints, times [s], and arrays of shape ``(n_points, n_joints)``.

    The arrays are positions and, if every point has them, velocities and accelerations.
    """

    joints: list[str]
    times: NDArray[np.float64]
    orders: list[NDArray[np.float64]]


def read_trajectory_messages(path: Path) -> Iterator[TrajectoryMessage]:
    """Read all messages of the type `trajectory_msgs/msg/JointTrajectory`, in the order of their times.

    A file that is damaged, or that has a message of another form, raises a ValueError.
    """
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    kind = get_message(_TYPE)
    try:
        with path.open("rb") as file:
            for schema, _, message in make_reader(file).iter_messages():
                if schema is not None and schema.name == _TYPE:
                    yield _read(deserialize(message.data, kind))
    except McapError as error:
        raise ValueError(error) from error


def _read(message: Any) -> TrajectoryMessage:
    stamps = [point.time_from_start.sec * NS_PER_S + point.time_from_start.nanosec for point in message.points]
    orders = []
    for name in ("positions", "velocities", "accelerations"):
        rows = [list(getattr(point, name)) for point in message.points]
        if not all(rows):
            break
        orders.append(np.array(rows, dtype=np.float64))
    return TrajectoryMessage(list(message.joint_names), np.array(stamps) / NS_PER_S, orders)
