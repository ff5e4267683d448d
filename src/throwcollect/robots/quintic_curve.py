"""Computes the quintic curve between the points of a joint trajectory, as joint trajectory controllers follow it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.robots.trajectory import JointTrajectory

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
    if len(knots) < 2:
        raise ValueError(f"a curve needs at least two points, got {len(knots)}")
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
