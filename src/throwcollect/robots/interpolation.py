"""The quintic curve between the points of a joint trajectory, as joint trajectory controllers follow it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.robots.trajectory import JointTrajectory

# Row k: coefficients of u^0 ... u^5 in the k-th of the curve's values at both ends of a segment, u = 0 ... 1:
# position, velocity, acceleration at u = 0, then the same at u = 1.
_HERMITE = np.array(
    [
        [1, 0, 0, -10, 15, -6],
        [0, 1, 0, -6, 8, -3],
        [0, 0, 0.5, -1.5, 1.5, -0.5],
        [0, 0, 0, 10, -15, 6],
        [0, 0, 0, -4, 7, -3],
        [0, 0, 0, 0.5, -1, 0.5],
    ]
)
_ORDERS = np.arange(6)


def sample_quintic(
    trajectory: JointTrajectory, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions, velocities and accelerations of a trajectory at given times.

    Each segment is the polynomial of degree 5 that takes position, velocity and acceleration of both its points;
    outside the trajectory the values are those of its nearest end.

    Args:
        trajectory: At least two points.
        times: Time since the start [s], shape ``(n,)``.

    Returns:
        Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``.

    Raises:
        ValueError: If the trajectory has fewer than two points.
    """
    coefficients, segments, u = _segments_at(trajectory, times)
    spans = np.diff(trajectory.times)[segments, np.newaxis]
    first = coefficients[1:] * _ORDERS[1:, np.newaxis, np.newaxis]
    second = first[1:] * _ORDERS[1:-1, np.newaxis, np.newaxis]
    return (
        _polynomial(coefficients, segments, u),
        _polynomial(first, segments, u) / spans,
        _polynomial(second, segments, u) / spans**2,
    )


def sample_positions(trajectory: JointTrajectory, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions alone of `sample_quintic`, at a fraction of its cost.

    Args:
        trajectory: At least two points.
        times: Time since the start [s], shape ``(n,)``.

    Returns:
        [rad], shape ``(n, n_joints)``.

    Raises:
        ValueError: If the trajectory has fewer than two points.
    """
    return _polynomial(*_segments_at(trajectory, times))


def _segments_at(
    trajectory: JointTrajectory, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Coefficients of all segments ``(6, n_segments, n_joints)``; segment ``(n,)`` and u ``(n, 1)`` at each time."""
    if len(trajectory.times) < 2:
        raise ValueError(f"a curve needs at least two points, got {len(trajectory.times)}")
    spans = np.diff(trajectory.times)
    step = spans[:, None]
    velocities, accelerations = trajectory.velocities, trajectory.accelerations
    ends = np.stack(
        [
            trajectory.positions[:-1],
            velocities[:-1] * step,
            accelerations[:-1] * step**2,
            trajectory.positions[1:],
            velocities[1:] * step,
            accelerations[1:] * step**2,
        ]
    )
    coefficients = (_HERMITE.T @ ends.reshape(6, -1)).reshape(ends.shape)
    last = len(spans) - 1
    segments = np.minimum(np.maximum(trajectory.times.searchsorted(times, side="right") - 1, 0), last)
    u = np.minimum(np.maximum((times - trajectory.times[segments]) / spans[segments], 0.0), 1.0)
    return coefficients, segments, u[:, np.newaxis]


def _polynomial(
    coefficients: NDArray[np.float64], segments: NDArray[np.intp], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Polynomials in u, lowest order first, of the segment at each time."""
    values: NDArray[np.float64] = coefficients[-1].take(segments, axis=0)
    for order in range(len(coefficients) - 2, -1, -1):
        values *= u
        values += coefficients[order].take(segments, axis=0)
    return values
