"""Turns vectors between the frame of a body, in which MuJoCo has angular velocities, and world."""

from __future__ import annotations

from collections.abc import Sequence

from throwcollect.engines.body import Vector
from throwcollect.engines.engine import Quaternion


def turn(orientation_xyzw: Sequence[float], vector: Sequence[float]) -> Vector:
    """Turn a vector from the frame of a body into world."""
    x, y, z, w = orientation_xyzw
    a, b, c = vector
    # With t = 2 u x v for the vector part u and the real part w, the turned vector is v + w t + u x t.
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p)


def turn_back(orientation_xyzw: Quaternion, vector: Vector) -> Vector:
    """Turn a vector from world into the frame of a body."""
    x, y, z, w = orientation_xyzw
    return turn((-x, -y, -z, w), vector)
