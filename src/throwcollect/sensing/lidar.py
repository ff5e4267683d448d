"""A lidar with one layer or several: how far the rays go, and what they hit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.pose import Pose
from throwcollect.episode.frames import WORLD
from throwcollect.reproducible_math import cos, sin
from throwcollect.sensing.decimation import Points, dot
from throwcollect.sensing.raster import NONE, Integers, Numbers, choose_nearest, spread
from throwcollect.sensing.scene import PlacedScene
from throwcollect.sensing.view import View

_SLACK = 1e-9
"""Rays this near to a triangle are tried, too, so that rounding loses none."""


@dataclass(frozen=True)
class Ranges:
    """What a lidar measures at one instant.

    Attributes:
        ranges: Distance along each ray [m], shape ``(layers, rays)``, float32: inf where nothing is as near as
            `Lidar.far_m`, and -inf where something is nearer than `Lidar.near_m`, as REP 117 has it.
        labels: Numbers in `Scene.labels`, shape ``(layers, rays)``, uint16.
    """

    ranges: NDArray[np.float32]
    labels: NDArray[np.uint16]


@dataclass(frozen=True)
class Lidar:
    """A lidar on a link, or in the world.

    Attributes:
        azimuths_rad: Angle of each ray from x to y, ascending by at most a turn in all.
        elevations_rad: Angle of each layer from the plane of x and y upwards, ascending, and not as steep as z.
        link: The link that carries it, or ``world``.
        pose: Its pose in the link: x forward, y left, z up.
        near_m: It cannot measure what is nearer.
        far_m: It sees nothing beyond.
    """

    azimuths_rad: tuple[float, ...]
    elevations_rad: tuple[float, ...] = (0.0,)
    link: str = WORLD
    pose: Pose = Pose()  # noqa: RUF009
    near_m: float = 0.1
    far_m: float = 30.0

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors along the rays, in the frame of the lidar, shape ``(3, layers, rays)``."""
        around, up = np.array(self.azimuths_rad), np.array(self.elevations_rad)[:, np.newaxis]
        return np.stack(
            [cos(up) * cos(around), cos(up) * sin(around), np.broadcast_to(sin(up), (len(up), len(around)))]
        )

    @cached_property
    def _grid(self) -> tuple[Numbers, Integers, Numbers]:
        """Turns of the rays in ascending order, twice; the numbers of these rays; the slopes of the layers."""
        around, up = np.array(self.azimuths_rad), np.array(self.elevations_rad)
        turns = _find_turns(cos(around), sin(around))
        order = np.argsort(turns, kind="stable")
        return np.concatenate([turns[order], turns[order] + 4]), order, sin(up) / cos(up)

    def scan(self, placed: PlacedScene) -> Ranges:
        """Measure a scene in one state."""
        pose = placed.find(self.link) * self.pose
        shape, directions = self.directions.shape[1:], self.directions.reshape(3, -1)
        view = View.of(placed, pose, self._may_see)
        distance, triangles = _trace(view, directions, *self._find_candidates(view))
        labels = np.zeros(len(distance), np.uint16)
        hit = triangles != NONE
        labels[hit] = placed.scene.labels_of[view.faces[triangles[hit]]]
        a, b, c = pose.rows[2]
        falls = -(a * directions[0] + b * directions[1] + c * directions[2])
        ground = max(pose.origin[2], 0.0) / np.maximum(falls, 1e-9)
        on_ground = (falls > 1e-9) & (ground > 0) & (ground < distance)
        distance, labels[on_ground] = np.where(on_ground, ground, distance), placed.scene.ground
        beyond = distance >= self.far_m
        distance[beyond], labels[beyond] = np.inf, 0
        distance[distance < self.near_m] = -np.inf
        return Ranges(distance.astype(np.float32).reshape(shape), labels.reshape(shape))

    def _may_see(self, middle: Vector, radius_m: float) -> bool:
        x, y, z = middle
        return x * x + y * y + z * z < (self.far_m + radius_m) ** 2

    def _find_candidates(self, view: View) -> tuple[Integers, Integers]:
        """Find pairs of a triangle and a ray that may hit it, with the numbers of both."""
        turns, order, slopes = self._grid
        (x, y, z), rays = view.corners.transpose(1, 0, 2), len(order)
        a, b, c = view.corners
        longest = np.sqrt(np.maximum(np.maximum(_square(b - a), _square(c - b)), _square(a - c)))
        away = np.sqrt(x * x + y * y)
        # No point of a triangle is farther than this share of its longest edge from the nearest of its corners.
        least, most = away.min(axis=0) - 0.578 * longest, away.max(axis=0)
        around = least <= 0
        least = np.maximum(least, 1e-9)
        low, high = z.min(axis=0), z.max(axis=0)
        below = np.searchsorted(slopes, low / np.where(low < 0, least, most) - _SLACK)
        above = np.searchsorted(slopes, high / np.where(high > 0, least, most) + _SLACK, side="right")
        turn = _find_turns(x, y)
        # What lies behind the lidar is on both sides of the turn at which numbers begin again.
        turn = np.where((turn.max(axis=0) - turn.min(axis=0) > 2) & (turn < 0), turn + 4, turn)
        first = np.searchsorted(turns, turn.min(axis=0) - _SLACK)
        last = np.searchsorted(turns, turn.max(axis=0) + _SLACK, side="right")
        first, many = np.where(around, 0, first), np.where(around, rays, np.minimum(last - first, rays))
        below, layers = np.where(around, 0, below), np.where(around, len(slopes), above - below)
        triangle, place = spread(many * np.maximum(layers, 0))
        layer, column = np.divmod(place, many[triangle])
        ray = order[(first[triangle] + column) % rays]
        return triangle, (below[triangle] + layer) * rays + ray


def _square(vectors: Points) -> Numbers:
    return dot(vectors, vectors)


def _find_turns(x: Numbers, y: Numbers) -> Numbers:
    """Find numbers from -2 to 2 that grow with the angle from x to y, without computing the angle."""
    turn: Numbers = 1 - x / np.maximum(np.abs(x) + np.abs(y), 1e-30)
    return np.where(y < 0, -turn, turn)


def _trace(view: View, directions: Points, triangle: Integers, ray: Integers) -> tuple[Numbers, Integers]:
    """Find, for each ray, the distance of the nearest triangle that it hits, and the number of this triangle."""
    edges = view.find_edges()
    normal = edges[0] + edges[1] + edges[2]
    offset = dot(view.corners[0], edges[0])
    along = directions[:, ray]
    weights = [dot(edge[:, triangle], along) for edge in edges]
    total = dot(normal[:, triangle], along)
    hits = np.flatnonzero(
        (weights[0] <= 0) & (weights[1] <= 0) & (weights[2] <= 0) & (total < 0) & (offset[triangle] < 0)
    )
    nearness = total[hits] / offset[triangle[hits]]
    chosen = choose_nearest(ray[hits], nearness, triangle[hits], directions.shape[1])
    distance = np.full(directions.shape[1], np.inf)
    hit = np.flatnonzero(chosen != NONE)
    distance[hit] = offset[chosen[hit]] / dot(normal[:, chosen[hit]], directions[:, hit])
    return distance, chosen
