"""A joint trajectory as plain arrays."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


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

    @cached_property
    def digest(self) -> str:
        """SHA-256 over names, times and all numbers, in hexadecimal: equal trajectories give equal digests."""
        # No name holds a zero byte, so names cannot run into each other. Numbers are little-endian, so that the digest
        # is the same on every machine.
        digest = hashlib.sha256("\0".join(self.joints).encode())
        for values in (self.times, self.positions, self.velocities, self.accelerations):
            digest.update(np.asarray(values, "<f8").tobytes())
        return digest.hexdigest()
