"""Samples as bare numbers, kept as they are until somebody asks for arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.episode.record import Samples
from throwcollect.robots.talos import JOINTS

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class BodyState:
    """A body at one instant.

    Attributes:
        position: Its origin in world [m]; that of the ball is its centre.
        orientation_xyzw: Unit quaternion, body to world.
        linear_velocity: In world [m/s].
        angular_velocity: In world [rad/s].
    """

    position: Vector
    orientation_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


class Row(NamedTuple):
    """The state of the world as the physics engine gives it.

    Attributes:
        joints: Position [rad], velocity [rad/s], reaction forces and motor torque [Nm] of each moving joint.
        pose: Position [m] and orientation (xyzw) of the ball.
        twist: Linear [m/s] and angular velocity [rad/s] of the ball.
    """

    joints: Sequence[tuple[Any, ...]]
    pose: tuple[Vector, Quaternion]
    twist: tuple[Vector, Vector]


Sample = tuple[float, ...]
"""One sample: positions, velocities and torques of all moving joints, then position, orientation, linear and angular
velocity of the ball. Bare numbers, as one is made every few steps: what the engine gives holds ten times as many
objects, and keeping those costs more than reading them."""

BALL_POSITION = slice(-13, -10)
BALL_LINEAR_VELOCITY = slice(-6, -3)
BALL_HEIGHT = -11
_BALL_NUMBERS = 13


def to_sample(row: Row) -> Sample:
    """What is recorded of a state."""
    positions, velocities, _, torques = zip(*row.joints, strict=True)
    (position, orientation), (linear, angular) = row.pose, row.twist
    return (*positions, *velocities, *torques, *position, *orientation, *linear, *angular)


def to_samples(
    rows: Sequence[Sample], stamps_ns: NDArray[np.int64], moving: Sequence[str], locked: Mapping[str, float]
) -> Samples:
    """Lay samples out as arrays of all 32 joints.

    Args:
        rows: The samples.
        stamps_ns: Their simulated times [ns], shape ``(n_rows,)``.
        moving: The joints of each sample.
        locked: Angle [rad] of each joint that is not in the samples.
    """
    count, width = len(rows), 3 * len(moving) + _BALL_NUMBERS
    table = np.fromiter(chain.from_iterable(rows), float, count * width).reshape(count, width)
    position, velocity, effort = np.zeros((3, count, len(JOINTS)))
    position[:, [JOINTS.index(joint) for joint in locked]] = list(locked.values())
    columns = [JOINTS.index(joint) for joint in moving]
    for array, values in zip((position, velocity, effort), np.split(table[:, :-_BALL_NUMBERS], 3, axis=1), strict=True):
        array[:, columns] = values
    return Samples(
        stamps_ns=stamps_ns,
        position=position,
        velocity=velocity,
        effort=effort,
        ball_position=table[:, BALL_POSITION],
        ball_orientation_xyzw=table[:, -10:-6],
        ball_linear_velocity=table[:, BALL_LINEAR_VELOCITY],
        ball_angular_velocity=table[:, -3:],
    )
