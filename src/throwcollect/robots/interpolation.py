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
    coefficients, powers, spans = _segments_at(trajectory, times)
    first = np.zeros_like(powers)
    first[:, 1:] = powers[:, :-1] * _ORDERS[1:]
    second = np.zeros_like(powers)
    second[:, 1:] = first[:, :-1] * _ORDERS[1:]
    velocities = np.einsum("nk,nkj->nj", first / spans, coefficients)
    accelerations = np.einsum("nk,nkj->nj", second / spans**2, coefficients)
    return np.einsum("nk,nkj->nj", powers, coefficients), velocities, accelerations


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
    coefficients, powers, _ = _segments_at(trajectory, times)
    positions: NDArray[np.float64] = np.einsum("nk,nkj->nj", powers, coefficients)
    return positions


def _segments_at(
    trajectory: JointTrajectory, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Of the segment at each time: coefficients ``(n, 6, n_joints)``, powers of u ``(n, 6)``, span [s] ``(n, 1)``."""
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
    coefficients = np.einsum("ek,esj->skj", _HERMITE, ends)
    segments = np.clip(trajectory.times.searchsorted(times, side="right") - 1, 0, len(spans) - 1)
    u = np.clip((times - trajectory.times[segments]) / spans[segments], 0.0, 1.0)
    powers = np.ones((len(times), len(_ORDERS)))
    powers[:, 1:] = np.multiply.accumulate(np.broadcast_to(u[:, None], (len(times), 5)), axis=1)
    return coefficients[segments], powers, spans[segments][:, None]
