"""Keeps the samples of engines, and lays them out as arrays."""

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
_NUMBER_BYTES = 8


class SampleLog:
    """Keeps samples as packed numbers: to free their Python objects after a trial takes longer than to pack them all.

    Attributes:
        last: The sample that was recorded last.
        forgotten: How many samples have been forgotten.

    Args:
        first: The first sample; all others have as many numbers.
    """

    def __init__(self, first: Sample) -> None:
        self._pack = struct.Struct(f"{len(first)}d").pack
        self._packed = bytearray()
        self._width = len(first)
        self.forgotten = 0
        self.append(first)

    def __len__(self) -> int:
        return self.forgotten + len(self._packed) // (self._width * _NUMBER_BYTES)

    def append(self, sample: Sample) -> None:
        """Record a sample."""
        self.last = sample
        self._packed += self._pack(*sample)

    def forget(self) -> None:
        """Drop all samples but the last one, so that a world can go on for ever; numbers of samples stay."""
        self.forgotten = len(self) - 1
        self._packed = self._packed[-self._width * _NUMBER_BYTES :]

    def table(self, first: int) -> NDArray[np.float64]:
        """Copy the samples from number `first` on, which is not forgotten, shape ``(n_samples, n_numbers)``."""
        skipped = (first - self.forgotten) * self._width
        return np.array(np.frombuffer(self._packed)[skipped:]).reshape(-1, self._width)


def to_samples(
    table: NDArray[np.float64],
    stamps_ns: NDArray[np.int64],
    joints: Sequence[str],
    moving: Sequence[str],
    locked: Mapping[str, float],
    offsets: NDArray[np.float64],
) -> Samples:
    """Lay samples out as arrays of all joints.

    Args:
        table: The samples, shape ``(n_samples, n_numbers)``.
        stamps_ns: Their simulated times [ns], shape ``(n_samples,)``.
        joints: All joints of the robot, in its order.
        moving: The joints that the samples hold.
        locked: Angle [rad] of each joint that the samples do not hold.
        offsets: True angle of each moving joint minus the angle that its sensor shows [rad], shape ``(n_moving,)``.
    """
    position, velocity, effort = np.zeros((3, len(table), len(joints)))
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
