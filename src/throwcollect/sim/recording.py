"""Lays the samples of engines out as arrays."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.engine import BALL_NUMBERS, Sample
from throwcollect.episode.record import Samples

BALL_POSITION = slice(-13, -10)
BALL_LINEAR_VELOCITY = slice(-6, -3)
BALL_HEIGHT = -11


def to_samples(
    rows: Sequence[Sample],
    stamps_ns: NDArray[np.int64],
    joints: Sequence[str],
    moving: Sequence[str],
    locked: Mapping[str, float],
    offsets: NDArray[np.float64],
) -> Samples:
    """Lay samples out as arrays of all joints.

    Args:
        rows: The samples.
        stamps_ns: Their simulated times [ns], shape ``(n_rows,)``.
        joints: All joints of the robot, in its order.
        moving: The joints that the samples hold.
        locked: Angle [rad] of each joint that the samples do not hold.
        offsets: True angle of each moving joint minus the angle that its sensor shows [rad], shape ``(n_moving,)``.
    """
    count, width = len(rows), 3 * len(moving) + BALL_NUMBERS
    # Packing row by row takes a third of the time in which NumPy makes an array of as many Python objects.
    pack = struct.Struct(f"{width}d").pack
    table = np.frombuffer(bytearray().join(pack(*row) for row in rows)).reshape(count, width)
    position, velocity, effort = np.zeros((3, count, len(joints)))
    position[:, [joints.index(joint) for joint in locked]] = list(locked.values())
    columns = [joints.index(joint) for joint in moving]
    for array, values in zip((position, velocity, effort), np.split(table[:, :-BALL_NUMBERS], 3, axis=1), strict=True):
        array[:, columns] = values
    if offsets.any():
        position[:, columns] -= offsets
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
