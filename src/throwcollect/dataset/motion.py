"""Motions of bodies and joints during one throw."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, repr=False)
class Body:
    """A body that moves, such as the ball, during a throw; world frame: x forward, y left, z up.

    Attributes:
        name: Its name.
        time_s: Time since the start of the trial [s], shape ``(n_samples,)``.
        stamps_ns: Simulated time [ns], shape ``(n_samples,)``; as in the messages.
        position: Centre [m], shape ``(n_samples, 3)``.
        orientation_xyzw: Unit quaternion, body to world, shape ``(n_samples, 4)``.
        velocity: Of the centre [m/s], shape ``(n_samples, 3)``.
        angular_velocity: [rad/s], shape ``(n_samples, 3)``.
    """

    name: str
    time_s: NDArray[np.float64]
    stamps_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    orientation_xyzw: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __repr__(self) -> str:
        return f"Body({self.name}: {len(self)} samples, {self.time_s[-1]:.3f} s)"


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


@dataclass(frozen=True, eq=False, repr=False)
class Joints:
    """The robot's joints during a throw; ``joints["arm_right_4_joint"]`` is one of them.

    Attributes:
        names: Their names, in the order of the columns of all arrays.
        time_s: Time since the start of the trial [s], shape ``(n_samples,)``.
        stamps_ns: Simulated time [ns], shape ``(n_samples,)``; as in the messages.
        position: [rad], shape ``(n_samples, n_joints)``.
        velocity: [rad/s], shape ``(n_samples, n_joints)``.
        effort: Torques of the motors [Nm], shape ``(n_samples, n_joints)``; 0 for locked joints.
    """

    names: tuple[str, ...]
    time_s: NDArray[np.float64]
    stamps_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __repr__(self) -> str:
        return f"Joints({len(self)} samples, {self.time_s[-1]:.3f} s)"

    def __getitem__(self, name: str) -> Joint:
        """Return one joint; its arrays are columns of the arrays of all joints."""
        if name not in self.names:
            raise KeyError(f"no joint {name!r}; there are {', '.join(self.names)}")
        which = self.names.index(name)
        return Joint(name, self.time_s, self.position[:, which], self.velocity[:, which], self.effort[:, which])

    def __iter__(self) -> Iterator[Joint]:
        return (self[name] for name in self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names
