"""Places a camera that sees a throw from the robot's right, and finds the places of points in its picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_OUTWARD = np.array([0.32, -1.0, 0.22])
"""Direction from the throw to the camera in world: a little in front of the robot, and a little above."""
_TANGENT = 0.24
"""Tangent of half the vertical angle of view: small, so that lines hardly converge."""
_NEAR_M, _FAR_M = 0.1, 100.0
_NEAREST_M = 0.5
_MARGIN = 0.06
"""Share of the picture that stays free on each side."""


@dataclass(frozen=True)
class Camera:
    """A camera at a place that looks along a direction, upright.

    Attributes:
        eye: Where it is in world [m], shape ``(3,)``.
        axes: Unit vectors to the right, up and backwards in world, one a row.
        aspect: Width over height of its picture.
    """

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    aspect: float

    @property
    def view(self) -> list[float]:
        """Matrix from world to camera in the convention of OpenGL, column by column."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ self.eye
        return matrix.T.ravel().tolist()

    @property
    def projection(self) -> list[float]:
        """Matrix from camera to clip space in the convention of OpenGL, column by column."""
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = 1 / (_TANGENT * self.aspect), 1 / _TANGENT
        matrix[2, 2] = (_FAR_M + _NEAR_M) / (_NEAR_M - _FAR_M)
        matrix[2, 3] = 2 * _FAR_M * _NEAR_M / (_NEAR_M - _FAR_M)
        matrix[3, 2] = -1
        return matrix.T.ravel().tolist()

    @property
    def horizon(self) -> float:
        """Share of its picture's height, from the top, at which level ground ends."""
        return float(1 - self.axes[2, 2] / (self.axes[1, 2] * _TANGENT)) / 2

    def faces(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Find out which points, in world [m], shape ``(n, 3)``, are well in front of the camera, shape ``(n,)``."""
        distance: NDArray[np.float64] = (self.eye - points) @ self.axes[2]
        return distance > _NEAREST_M

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Find the places of points in the picture, which are in world [m] in front of the camera, shape ``(n, 3)``.

        Places are shares of its width from the left and of its height from the top, shape ``(n, 2)``.
        """
        seen = (points - self.eye) @ self.axes.T
        right, up = seen[:, 0] / (-seen[:, 2] * _TANGENT * self.aspect), seen[:, 1] / (-seen[:, 2] * _TANGENT)
        return np.stack([(1 + right) / 2, (1 - up) / 2], axis=1)


def camera_on(points: NDArray[np.float64], aspect: float) -> Camera:
    """Place the camera as near as possible with all points in its picture.

    The points are in world [m], shape ``(n, 3)``; the aspect is width over height of the picture.
    """
    back = _OUTWARD / np.linalg.norm(_OUTWARD)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    # From here on the places are in the frame of the camera, whose third axis points backwards.
    axes = np.stack([right, np.cross(back, right), back])
    seen = points @ axes.T
    # A point is in the picture if its distance from the axis is below the tangent times its distance along the axis.
    place = np.empty(3)
    needed = []
    for axis, tangent in ((0, _TANGENT * aspect), (1, _TANGENT)):
        slope = tangent * (1 - 2 * _MARGIN)
        upper, lower = np.max(seen[:, axis] + slope * seen[:, 2]), np.max(-seen[:, axis] + slope * seen[:, 2])
        # The two outermost lines of this slope, one on each side, meet at the nearest place that sees all points.
        place[axis] = (upper - lower) / 2
        needed.append((upper + lower) / (2 * slope))
    place[2] = max(needed)
    return Camera(place @ axes, axes, aspect)
