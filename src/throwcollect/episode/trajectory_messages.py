"""Reads the joint trajectories of an MCAP file of ROS 2, whatever program wrote it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces import deserialize, get_message

_TYPE = "trajectory_msgs/msg/JointTrajectory"


class TrajectoryMessage(NamedTuple):
    """Joints, times [s], and positions, possibly with velocities and accelerations, each ``(n_points, n_joints)``."""

    joints: list[str]
    times: NDArray[np.float64]
    orders: list[NDArray[np.float64]]


def read_trajectory_messages(path: Path) -> Iterator[TrajectoryMessage]:
    """Read all messages of this type in the order of their times; a damaged file raises a ValueError."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as file:
            for schema, _, message in make_reader(file).iter_messages():
                if schema is not None and schema.name == _TYPE:
                    yield _read(deserialize(message.data, get_message(_TYPE)))
    except McapError as error:
        raise ValueError(error) from error


def _read(message: Any) -> TrajectoryMessage:
    times = [point.time_from_start.sec + point.time_from_start.nanosec / 1e9 for point in message.points]
    names = ("positions", "velocities", "accelerations")
    orders = [np.array([getattr(point, name) for point in message.points], np.float64) for name in names]
    return TrajectoryMessage(list(message.joint_names), np.array(times), [order for order in orders if order.size])
