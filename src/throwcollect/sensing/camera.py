"""A camera: which triangle each pixel sees, how far it is, and what belongs to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.pose import OPTICAL, Pose
from throwcollect.episode.frames import WORLD
from throwcollect.episode.sensor_topics import focal_length
from throwcollect.sensing.raster import NONE, Outlines, clip_near, find_nearest
from throwcollect.sensing.scene import PlacedScene
from throwcollect.sensing.shading import Seen, shade
from throwcollect.sensing.view import View

_STEP = 0.02
"""Share by which the depth changes at an edge of a body in front of itself."""


@dataclass(frozen=True)
class Frame:
    """What a camera sees at one instant.

    Attributes:
        depth: Distance along the optical axis [m], shape ``(height, width)``, float32; inf where nothing is as near as
            `Camera.far_m`, as REP 117 and REP 118 have it.
        labels: Numbers in `Scene.labels`, shape ``(height, width)``, uint16.
        color: Red, green and blue, shape ``(height, width, 3)``, uint8; None if it was not asked for.
    """

    depth: NDArray[np.float32]
    labels: NDArray[np.uint16]
    color: NDArray[np.uint8] | None


@dataclass(frozen=True)
class Camera:
    """A pinhole camera on a link, or in the world.

    Attributes:
        width: Pixels in a row.
        height: Number of rows.
        vertical_fov_rad: Angle between the upper and the lower end of its pictures.
        link: The link that carries it, or ``world``.
        pose: Its pose in the link: x forward, y left, z up.
        near_m: It looks through what is nearer, along the optical axis, such as the link that it is in.
        far_m: It sees nothing beyond, along the optical axis.
        smooth: Whether edges in `Frame.color` are smooth: each pixel is the mean of four.
        shadows: Whether what the sun does not reach is darker.
    """

    width: int
    height: int
    vertical_fov_rad: float
    link: str = WORLD
    pose: Pose = Pose()  # noqa: RUF009
    near_m: float = 0.02
    far_m: float = 100.0
    smooth: bool = False
    shadows: bool = True

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, across and down."""
        return focal_length(self.height, self.vertical_fov_rad)

    def find_optical(self, placed: PlacedScene) -> Pose:
        """Find the pose in world of the optical frame: x right, y down, z forward."""
        return placed.find(self.link) * self.pose * OPTICAL

    def render(self, placed: PlacedScene, *, color: bool = True) -> Frame:
        """Take a picture of a scene in one state."""
        optical = self.find_optical(placed)
        seen = self._look(placed, optical)
        labels = seen.find_labels(placed.scene).reshape(self.height, self.width)
        depth = seen.depth.astype(np.float32).reshape(self.height, self.width)
        if not color:
            return Frame(depth, labels, None)
        picture = shade(seen, placed, optical, shadows=self.shadows)
        if self.smooth:
            self._smooth(picture, placed, optical)
        levels = (picture + np.float32(0.5)).astype(np.uint8).T
        return Frame(depth, labels, np.ascontiguousarray(levels).reshape(self.height, self.width, 3))

    def _smooth(self, picture: NDArray[np.float32], placed: PlacedScene, optical: Pose) -> None:
        """Give pixels at edges the mean colour of their four quarters."""
        finer = replace(self, width=2 * self.width, height=2 * self.height)
        seen = finer._look(placed, optical)
        row, column = np.divmod(np.arange(self.width * self.height), self.width)
        first = 4 * row * self.width + 2 * column
        quarters = first + np.array([[0], [1], [2 * self.width], [2 * self.width + 1]])
        labels, near = seen.find_labels(placed.scene)[quarters], 1 / seen.depth[quarters]
        nearest = near.max(axis=0)
        steps = (nearest - near.min(axis=0) > _STEP * nearest) & (labels[0] != placed.scene.ground)
        edges = np.flatnonzero((labels != labels[0]).any(axis=0) | steps)
        chosen = seen.choose(quarters[:, edges].ravel())
        one, two, three, four = np.split(shade(chosen, placed, optical, shadows=self.shadows), 4, axis=1)
        picture[:, edges] = ((one + two) + (three + four)) / 4

    def _look(self, placed: PlacedScene, optical: Pose) -> Seen:
        """Find what each pixel sees."""
        width, height, focal = self.width, self.height, self.focal_px
        view = View.of(placed, optical, self._may_see)
        z = view.corners[:, 2]
        view = view.choose((z.max(axis=0) > self.near_m) & (z.min(axis=0) < self.far_m))
        corners, owner = clip_near(view.corners, np.arange(view.corners.shape[2]), self.near_m)
        enlarged = focal / corners[:, 2]
        outlines = Outlines(corners[:, 0] * enlarged + width / 2, corners[:, 1] * enlarged + height / 2, owner)
        normal, offset = view.find_planes()
        # The inverse of the depth changes by the same amount from each pixel to the next.
        right, down = normal[0] / (offset * focal), normal[1] / (offset * focal)
        nearness = right, down, normal[2] / offset - width / 2 * right - height / 2 * down
        triangles = find_nearest(outlines, nearness, width, height)
        across = (np.arange(width) + 0.5 - width / 2) / focal
        along = (np.arange(height) + 0.5 - height / 2) / focal
        x, y = np.tile(across, height), np.repeat(along, width)
        pixels = np.flatnonzero(triangles != NONE)
        chosen = triangles[pixels]
        nx, ny, nz = normal[:, chosen]
        depth = np.full(width * height, np.inf)
        depth[pixels] = offset[chosen] / (nx * x[pixels] + ny * y[pixels] + nz)
        (a, b, c), eye_height = optical.rows[2], optical.origin[2]
        falls = -(a * x + b * y + c)
        # Where the ray does not fall, or from below, there is no ground.
        ground = max(eye_height, 0.0) / np.maximum(falls, 1e-9)
        on_ground = (falls > 1e-9) & (ground > self.near_m) & (ground < depth)
        depth = np.where(on_ground, ground, depth)
        beyond = depth >= self.far_m
        depth[beyond] = np.inf
        triangles[on_ground | beyond] = NONE
        return Seen(view, 1 / focal, x, y, depth, triangles, on_ground & ~beyond)

    def _may_see(self, middle: Vector, radius_m: float) -> bool:
        x, y, z = middle
        focal = self.focal_px
        if z + radius_m <= self.near_m or z - radius_m >= self.far_m:
            return False
        return all(
            abs(aside) * focal - z * size / 2 <= radius_m * math.hypot(focal, size / 2)
            for aside, size in ((x, self.width), (y, self.height))
        )
