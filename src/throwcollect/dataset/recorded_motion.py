"""Motions of ball and joints during one throw: arrays that are read from the recording when first asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.named_array import unknown_name
from throwcollect.dataset.trajectory_columns import TIMES, Column, Recorded, empty_columns, fill
from throwcollect.episode.trajectory_rows import STAMPS


class LazyRows:
    """The rows of an episode, decompressed when a column is first asked for, and kept."""

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that are recorded."""
        return self._recorded.joints

    @cached_property
    def _rows(self) -> NDArray[np.void]:
        return self._recorded.read_rows()

    def column(self, name: str) -> Column:
        """Read a column into an array of its own."""
        joints = self._recorded.joints
        columns = empty_columns([name], self._recorded.samples, len(joints))
        fill(columns, [self._recorded], [self._rows], joints)
        return columns[name]


class Series:
    """Columns that share their times; each is read when it is first asked for, into an array of its own."""

    _prefix = ""

    def __init__(self, recording: LazyRows) -> None:
        self._recording = recording

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} samples, {self.time_s[-1]:.3f} s)"

    def _read_column(self, name: str) -> Column:
        return self._recording.column(f"{self._prefix}_{name}")

    @cached_property
    def time_s(self) -> NDArray[np.float64]:
        """Time since the start of the trial [s], shape ``(n_samples,)``."""
        return self._recording.column(TIMES)

    @cached_property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Simulated time [ns], shape ``(n_samples,)``; as in the messages."""
        return self._recording.column(STAMPS)


class Ball(Series):
    """The ball during a throw; world frame: x forward, y left, z up."""

    _prefix = "ball"

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Centre [m], shape ``(n_samples, 3)``."""
        return self._read_column("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """Of the centre [m/s], shape ``(n_samples, 3)``."""
        return self._read_column("velocity")

    @cached_property
    def orientation_xyzw(self) -> NDArray[np.float64]:
        """Unit quaternion, ball to world, shape ``(n_samples, 4)``."""
        return self._read_column("orientation_xyzw")

    @cached_property
    def angular_velocity(self) -> NDArray[np.float64]:
        """[rad/s], shape ``(n_samples, 3)``."""
        return self._read_column("angular_velocity")


@dataclass(frozen=True)
class Joint:
    """One joint during a throw.

    Attributes:
        name: Its name.
        time_s: Time since the start of the trial [s], shape ``(n_samples,)``, as all others.
        position: [rad].
        velocity: [rad/s].
        effort: Torque of its motor [Nm]; 0 if it is locked.
    """

    name: str
    time_s: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]


class Joints(Series):
    """The robot's joints during a throw; ``joints["arm_right_4_joint"]`` is one of them."""

    _prefix = "joints"

    def __getitem__(self, name: str) -> Joint:
        """Return one joint; its arrays are columns of the arrays of all joints."""
        if name not in self.names:
            raise unknown_name("joint", name, self.names)
        which = self.names.index(name)
        return Joint(name, self.time_s, self.position[:, which], self.velocity[:, which], self.effort[:, which])

    def __iter__(self) -> Iterator[Joint]:
        return (self[name] for name in self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in the order of the columns of all arrays."""
        return self._recording.joints

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """[rad], shape ``(n_samples, n_joints)``."""
        return self._read_column("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """[rad/s], shape ``(n_samples, n_joints)``."""
        return self._read_column("velocity")

    @cached_property
    def effort(self) -> NDArray[np.float64]:
        """Torques of the motors [Nm], shape ``(n_samples, n_joints)``; 0 for locked joints."""
        return self._read_column("effort")
