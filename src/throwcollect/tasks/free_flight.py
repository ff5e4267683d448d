"""Computes the free flight of the ball, step by step as the physics engine does."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.scene import BALL
from throwcollect.config.schema import Config


def ballistic_positions(
    position: NDArray[np.float64], velocity: NDArray[np.float64], *, steps: int, config: Config
) -> NDArray[np.float64]:
    """Compute the path of one ball in free flight.

    Args:
        position: Ball centre at the start [m], shape ``(3,)``.
        velocity: Velocity of the ball at the start [m/s], shape ``(3,)``.
        steps: Number of physics steps.
        config: Gravity, air, ball and physics rate.

    Returns:
        Ball centre [m] at the start and after each step, shape ``(steps + 1, 3)``.
    """
    dt, gravity_mps2 = 1 / config.sim.physics_hz, config.scene.gravity_mps2
    drag_per_m = _drag_per_m(config)
    if drag_per_m == 0:
        # Like the loop below, these sums run from the first row to the last, so the bits are the same.
        velocities = np.full((steps + 1, 3), [0.0, 0.0, -gravity_mps2 * dt])
        velocities[0] = velocity
        moves = np.add.accumulate(velocities) * dt
        moves[0] = position
        return np.add.accumulate(moves)
    x, y, z = map(float, position)
    vx, vy, vz = map(float, velocity)
    path = [(x, y, z)]
    for _ in range(steps):
        braking = drag_per_m * math.sqrt(vx * vx + vy * vy + vz * vz)
        vx -= braking * vx * dt
        vy -= braking * vy * dt
        vz -= (gravity_mps2 + braking * vz) * dt
        x += vx * dt
        y += vy * dt
        z += vz * dt
        path.append((x, y, z))
    return np.array(path)


def ballistic_steps(
    position: NDArray[np.float64], velocity: NDArray[np.float64], *, steps: int, config: Config
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute positions and velocities of many balls, each of shape ``(n, 3)``, after some steps of free flight.

    Arithmetic and arguments are as in `ballistic_positions`.
    """
    dt, drag_per_m = 1 / config.sim.physics_hz, _drag_per_m(config)
    gravity = np.array([0.0, 0.0, -config.scene.gravity_mps2])
    for _ in range(steps):
        vx, vy, vz = velocity.T
        braking = (drag_per_m * np.sqrt(vx * vx + vy * vy + vz * vz))[:, np.newaxis]
        velocity = velocity + (gravity - braking * velocity) * dt
        position = position + velocity * dt
    return position, velocity


def _drag_per_m(config: Config) -> float:
    """Compute the ball's deceleration by the air over the square of its speed [1/m]."""
    if config.acted_on != BALL:
        return 0.0
    ball = config.ball
    area = math.pi * ball.radius_m**2
    return 0.5 * config.scene.air_density_kgpm3 * ball.drag_coefficient * area / ball.mass_kg
