"""A joint trajectory as plain arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.interpolation import quintic


@dataclass(frozen=True)
class JointTrajectory:
    """Points in joint space over time, at rest before the first point and after the last.

    Attributes:
        joints: Joint names, shape ``(n_joints,)``.
        times: Time since the start [s], strictly increasing, shape ``(n_points,)``.
        positions: [rad], shape ``(n_points, n_joints)``.
        velocities: [rad/s], shape ``(n_points, n_joints)``.
        accelerations: [rad/s²], shape ``(n_points, n_joints)``.
    """

    joints: tuple[str, ...]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Refuse numbers that are no motion."""
        points, of_joints = len(self.times), (len(self.times), len(self.joints))
        shapes = {"times": (points,), "positions": of_joints, "velocities": of_joints, "accelerations": of_joints}
        for name, shape in shapes.items():
            values = getattr(self, name)
            if np.shape(values) != shape:
                raise ValueError(f"{name} of a trajectory should have the shape {shape}, have {np.shape(values)}")
            if not np.isfinite(values).all():
                raise ValueError(f"{name} of a trajectory hold numbers that are not finite")
        if not points or (self.times[1:] <= self.times[:-1]).any():
            raise ValueError("times of a trajectory should increase")

    @cached_property
    def quintics(self) -> NDArray[np.float64]:
        """Coefficients of the quintic of each segment, lowest power first, shape ``(n_points - 1, 6, n_joints)``.

        Their variable is the share of the segment that has passed.
        """
        scale = (self.times[1:] - self.times[:-1])[:, np.newaxis]
        origin, moved = self.positions[:-1], self.positions[1:] - self.positions[:-1]
        v0, v1 = self.velocities[:-1] * scale, self.velocities[1:] * scale
        a0, a1 = self.accelerations[:-1] * scale**2, self.accelerations[1:] * scale**2
        return np.stack([origin, *quintic(moved, v0, v1, a0, a1)], axis=1)

    @cached_property
    def digest(self) -> str:
        """SHA-256 over names, times and all numbers, in hexadecimal: equal trajectories give equal digests."""
        # No name holds a zero byte, so names cannot run into each other. Numbers are little-endian, so that the digest
        # is the same on every machine.
        digest = hashlib.sha256("\0".join(self.joints).encode())
        for values in (self.times, self.positions, self.velocities, self.accelerations):
            digest.update(np.asarray(values, "<f8").tobytes())
        return digest.hexdigest()


def rest_at(posture: Mapping[str, float]) -> JointTrajectory:
    """Make the trajectory of joints that rest, for a second, at these angles [rad]."""
    still = np.zeros((2, len(posture)))
    positions = np.tile(np.array(list(posture.values())), (2, 1))
    return JointTrajectory(tuple(posture), np.array([0.0, 1.0]), positions, still, still)
