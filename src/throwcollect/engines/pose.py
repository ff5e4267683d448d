"""Poses, computed number by number in a fixed order, so that no library for matrices decides on their last bits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from throwcollect.engines.body import Vector

Rows = tuple[Vector, Vector, Vector]
"""The rows of a rotation matrix, frame to parent."""


def dot(one: Vector, other: Vector) -> float:
    """Multiply two vectors."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def cross(one: Vector, other: Vector) -> Vector:
    """Find the vector that is at right angles to two others."""
    (a, b, c), (x, y, z) = one, other
    return b * z - c * y, c * x - a * z, a * y - b * x


def transpose(rows: Rows) -> Rows:
    """Exchange the rows of a matrix for its columns."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, d, g), (b, e, h), (c, f, i)


def multiply(one: Sequence[Any], other: Sequence[Any]) -> tuple[Any, Any, Any, Any]:
    """Multiply quaternions xyzw, of numbers or arrays: a rotation by the other one, and then by the first one."""
    (x1, y1, z1, w1), (x2, y2, z2, w2) = one, other
    return (
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
    )


class Pose(NamedTuple):
    """Pose of a frame in its parent: the rows of the rotation, frame to parent, and the origin [m]."""

    rows: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    origin: Vector = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, origin: Sequence[float], rotation_xyzw: Sequence[float]) -> Pose:
        """Make the pose of an origin [m] and a unit quaternion, frame to parent."""
        (a, b, c), (x, y, z, w) = map(float, origin), map(float, rotation_xyzw)
        rows = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        return cls(rows, (a, b, c))

    @classmethod
    def looking_at(cls, eye: Sequence[float], target: Sequence[float]) -> Pose:
        """Make the pose of a sensor at one point [m] whose x points at another one, and whose y is level."""
        (x, y, z), (a, b, c) = map(float, eye), map(float, target)
        forward = _normalise((a - x, b - y, c - z))
        # What looks straight up or down has its y along that of the world.
        across = math.hypot(forward[0], forward[1])
        left = (-forward[1] / across, forward[0] / across, 0.0) if across > 1e-9 else (0.0, 1.0, 0.0)
        return cls(transpose((forward, left, cross(forward, left))), (x, y, z))

    def turn(self, vector: Vector) -> Vector:
        """Write a direction in the frame along the axes of the parent."""
        return dot(self.rows[0], vector), dot(self.rows[1], vector), dot(self.rows[2], vector)

    def move(self, point: Vector) -> Vector:
        """Find a point of the frame in the parent [m]."""
        (x, y, z), (a, b, c) = self.turn(point), self.origin
        return x + a, y + b, z + c

    def __mul__(self, inner: Pose) -> Pose:  # type: ignore[override]
        """Find the pose in the parent of a frame in this frame."""
        columns = transpose(inner.rows)
        one, two, three = (self.turn(column) for column in columns)
        return Pose(transpose((one, two, three)), self.move(inner.origin))

    def inverse(self) -> Pose:
        """Find the pose of the parent in the frame."""
        turned = Pose(transpose(self.rows))
        x, y, z = turned.turn(self.origin)
        return Pose(turned.rows, (-x, -y, -z))


def _normalise(vector: Vector) -> Vector:
    x, y, z = vector
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


OPTICAL = Pose(((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""Pose of an optical frame (x right, y down, z forward) in that of its camera (x forward, y left, z up), by REP 103."""
