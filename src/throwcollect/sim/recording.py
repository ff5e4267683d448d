"""Samples as the physics engine gives them, kept as they are until somebody asks for arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.episode.record import Samples
from throwcollect.robots.talos import JOINTS

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class BallState:
    """The ball at one instant.

    Attributes:
        position: Centre in world [m].
        orientation_xyzw: Unit quaternion, ball to world.
        linear_velocity: In world [m/s].
        angular_velocity: In world [rad/s].
    """

    position: Vector
    orientation_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


class Row(NamedTuple):
    """One sample; a tuple, as one is made for every sample while the physics waits.

    Attributes:
        joints: Position [rad], velocity [rad/s], reaction forces and motor torque [Nm] of each moving joint.
        pose: Position [m] and orientation (xyzw) of the ball.
        twist: Linear [m/s] and angular velocity [rad/s] of the ball.
    """

    joints: Sequence[tuple[Any, ...]]
    pose: tuple[Vector, Quaternion]
    twist: tuple[Vector, Vector]


def to_samples(
    rows: Sequence[Row], stamps_ns: NDArray[np.int64], moving: Sequence[str], locked: Mapping[str, float]
) -> Samples:
    """Lay rows out as arrays of all 32 joints.

    Args:
        rows: The samples.
        stamps_ns: Their simulated times [ns], shape ``(n_rows,)``.
        moving: The joints of each row.
        locked: Angle [rad] of each joint that is not in the rows.
    """
    count = len(rows)
    position, velocity, effort = np.zeros((3, count, len(JOINTS)))
    position[:, [JOINTS.index(joint) for joint in locked]] = list(locked.values())
    columns = [JOINTS.index(joint) for joint in moving]
    # Flat lists: numpy reads them several times faster than nested ones.
    states = [state for row in rows for state in row.joints]
    for array, field in ((position, 0), (velocity, 1), (effort, 3)):
        array[:, columns] = np.array([state[field] for state in states]).reshape(count, len(columns))
    return Samples(
        stamps_ns=stamps_ns,
        position=position,
        velocity=velocity,
        effort=effort,
        ball_position=np.array([x for row in rows for x in row.pose[0]]).reshape(count, 3),
        ball_orientation_xyzw=np.array([x for row in rows for x in row.pose[1]]).reshape(count, 4),
        ball_linear_velocity=np.array([x for row in rows for x in row.twist[0]]).reshape(count, 3),
        ball_angular_velocity=np.array([x for row in rows for x in row.twist[1]]).reshape(count, 3),
    )
