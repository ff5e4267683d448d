"""A joint trajectory as plain arrays, and the quintic curve between its points, as controllers follow it."""

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
        points, shape = len(self.times), (len(self.times), len(self.joints))
        for name in ("positions", "velocities", "accelerations"):
            values = getattr(self, name)
            if np.shape(values) != shape or not np.isfinite(values).all():
                raise ValueError(f"{name} of a trajectory should be finite numbers of the shape {shape}")
        if not points or not (self.times[1:] > self.times[:-1]).all() or not np.isfinite(self.times).all():
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


_ORDERS = np.arange(6)


def sample_quintic(
    trajectory: JointTrajectory, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Compute positions, velocities and accelerations of a trajectory at given times.

    Each segment is the polynomial of degree 5 that has the positions, velocities and accelerations of both its points.
    Outside of the trajectory, the values are those at its nearest end.

    Args:
        trajectory: At least two points.
        times: Time since the start [s], shape ``(n,)``.

    Returns:
        Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``.
    """
    coefficients, u, spans = _find_polynomials(trajectory, times)
    first = coefficients[1:] * _ORDERS[1:, np.newaxis, np.newaxis]
    second = first[1:] * _ORDERS[1:-1, np.newaxis, np.newaxis]
    return _evaluate(coefficients, u).T, (_evaluate(first, u) / spans).T, (_evaluate(second, u) / spans**2).T


def sample_positions(trajectory: JointTrajectory, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the positions of `sample_quintic` alone, at a fraction of its cost."""
    coefficients, u, _ = _find_polynomials(trajectory, times)
    return _evaluate(coefficients, u).T


def _find_polynomials(
    trajectory: JointTrajectory, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Find the segment of the curve at each time.

    Returns:
        Coefficients of the segment's polynomials ``(6, n_joints, n)``, the place u in the segment from 0 to 1, and the
        length of the segment [s], both of shape ``(n,)``.
    """
    knots = trajectory.times
    coefficients = trajectory.quintics
    # Only the inner knots are searched, so that times outside of the trajectory belong to its first or last segment.
    segments = knots[1:-1].searchsorted(times, side="right")
    spans = (knots[1:] - knots[:-1])[segments]
    u = np.minimum(np.maximum((times - knots[segments]) / spans, 0.0), 1.0)
    rows = coefficients.reshape(len(coefficients), -1).take(segments, axis=0)
    # Time is the last axis, so that arithmetic runs along memory.
    return np.ascontiguousarray(rows.T).reshape(*coefficients.shape[1:], len(times)), u, spans


def _evaluate(coefficients: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate polynomials in u, ``(n_joints, n)``; coefficients ``(n_orders, n_joints, n)``, lowest order first."""
    values: NDArray[np.float64] = coefficients[-1].copy()
    for coefficient in coefficients[-2::-1]:
        values *= u
        values += coefficient
    return values
