"""Triangles in the frame of a sensor, and the arithmetic of rays through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.pose import Pose
from throwcollect.sensing.decimation import Points, cross, dot
from throwcollect.sensing.scene import PlacedScene


@dataclass(frozen=True)
class View:
    """Those triangles that face a sensor.

    Attributes:
        corners: In the frame of the sensor [m], shape ``(3, 3, n)``: corner, axis, triangle.
        faces: Their numbers in the arrays of the scene, shape ``(n,)``.
        parts: Number of the part of each, shape ``(n,)``.
    """

    corners: NDArray[np.float64]
    faces: NDArray[np.int64]
    parts: NDArray[np.int64]

    @classmethod
    def of(
        cls, placed: PlacedScene, sensor: Pose, sees: Callable[[Vector, float], bool], *, parallel: bool = False
    ) -> View:
        """Find the triangles that face a sensor.

        Args:
            placed: The scene.
            sensor: Pose of the sensor in world.
            sees: Whether the sensor may see something in a ball of some centre and radius, in its frame [m].
            parallel: Whether all rays are along the z of the sensor, and do not begin at its origin.
        """
        scene, back = placed.scene, sensor.inverse()
        here = [back * pose for pose in placed.poses]
        seen = [
            bool(size) and sees(pose.move(middle), radius)
            for size, pose, (middle, radius) in zip(scene.corners_of.tolist(), here, scene.balls, strict=True)
        ]
        # A number for each corner of a part, or for each triangle of it.
        x, y, z = scene.corners
        rows = np.array([(*row, origin) for pose in here for row, origin in zip(*pose, strict=True)]).reshape(-1, 3, 4)
        turns = np.repeat(rows.transpose(1, 2, 0), scene.corners_of, axis=2)
        corners = np.stack([a * x + b * y + c * z + origin for a, b, c, origin in turns])
        eyes = [pose.rows[2] if parallel else pose.inverse().origin for pose in here]
        a, b, c = np.array(eyes).T[:, scene.parts]
        x, y, z, offset = scene.planes
        facing = x * a + y * b + z * c
        front = facing < 0 if parallel else facing > offset
        faces = np.flatnonzero(front & np.array(seen)[scene.parts])
        return cls(corners[:, scene.faces[:, faces]].transpose(1, 0, 2), faces, scene.parts[faces])

    def choose(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> View:
        """Choose some of the triangles."""
        return View(self.corners[:, :, chosen], self.faces[chosen], self.parts[chosen])

    def find_edges(self) -> tuple[Points, Points, Points]:
        """Find, for each corner, the normal of the plane through the sensor and the edge opposite of it.

        A ray through the triangle is on the same side of all three: its products with them are not above 0. These
        products are weights: what has some value at each corner has their mean where the ray hits the triangle.
        """
        a, b, c = self.corners
        return cross(b, c), cross(c, a), cross(a, b)

    def find_planes(self) -> tuple[Points, NDArray[np.float64]]:
        """Find the normal of each triangle, and its product with a point of the triangle, which is below 0."""
        a, b, c = self.corners
        normal = cross(b - a, c - a)
        return normal, np.minimum(dot(normal, a), -1e-30)
