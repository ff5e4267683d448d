"""Keeps what is recorded of a trial: the samples of the engine, and which bodies press on the object, for how long."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Mapping, Sequence, Set

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.engine import BODY_NUMBERS, Sample
from throwcollect.episode.record import Contact, Samples

OBJECT_POSITION = slice(-13, -10)
OBJECT_LINEAR_VELOCITY = slice(-6, -3)
_NUMBER_BYTES = 8


class SampleLog:
    """Keeps samples as packed numbers: to free their Python objects after a trial takes longer than to pack them all.

    Attributes:
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
        self._packed += self._pack(*sample)

    def extend(self, samples: NDArray[np.float64]) -> None:
        """Record samples, shape ``(n_samples, n_numbers)``."""
        self._packed += samples.tobytes()

    def forget(self) -> None:
        """Drop all samples but the last one, so that a world can go on for ever; numbers of samples stay."""
        self.forgotten = len(self) - 1
        self._packed = self._packed[-self._width * _NUMBER_BYTES :]

    def table(self, first: int) -> NDArray[np.float64]:
        """Copy the samples from number `first` on, which is not forgotten, shape ``(n_samples, n_numbers)``."""
        skipped = (first - self.forgotten) * self._width
        return np.array(np.frombuffer(self._packed)[skipped:]).reshape(-1, self._width)


class ContactLog:
    """Intervals, counted in physics steps, in which bodies press on the object."""

    def __init__(self) -> None:
        self._open: dict[str, int] = {}
        self._closed: list[tuple[int, str, int]] = []

    @property
    def bodies(self) -> Collection[str]:
        """Names of the bodies that press on the object now."""
        return self._open.keys()

    def update(self, bodies: Set[str], step: int) -> None:
        """Note the names of all bodies that press on the object from a step on; steps must ascend from call to call."""
        for body in self._open.keys() - bodies:
            self._closed.append((self._open.pop(body), body, step))
        for body in bodies - self._open.keys():
            self._open[body] = step

    def intervals(self, stamp_ns: Callable[[int], int]) -> tuple[Contact, ...]:
        """List all intervals by start time, then by name; `stamp_ns` gives the time [ns] at the end of a step."""
        ended = [(start, body, stamp_ns(end)) for start, body, end in self._closed]
        lasting = [(start, body, None) for body, start in self._open.items()]
        return tuple(
            Contact(body=body, start_ns=stamp_ns(start), end_ns=end_ns)
            # Only start and body are compared: the end of an interval that lasts is None, which cannot be compared.
            for start, body, end_ns in sorted([*ended, *lasting], key=lambda interval: interval[:2])
        )


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
    joint_columns, others = np.split(table, [3 * len(moving)], axis=1)
    for array, values in zip((position, velocity, effort), np.split(joint_columns, 3, axis=1), strict=True):
        array[:, columns] = values
    if offsets.any():
        position[:, columns] -= offsets
    return Samples(
        stamps_ns=stamps_ns,
        position=position,
        velocity=velocity,
        effort=effort,
        object_position=table[:, OBJECT_POSITION],
        object_orientation_xyzw=table[:, -10:-6],
        object_linear_velocity=table[:, OBJECT_LINEAR_VELOCITY],
        object_angular_velocity=table[:, -3:],
        bodies=others[:, :-BODY_NUMBERS].reshape(len(table), others.shape[1] // BODY_NUMBERS - 1, BODY_NUMBERS),
    )
