"""Colours of pixels: light from one side and from the sky, shadows, and a ground of tiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.pose import OPTICAL, Pose
from throwcollect.sensing.decimation import dot
from throwcollect.sensing.raster import NONE, Integers, Numbers, Outlines, find_nearest
from throwcollect.sensing.scene import PlacedScene, Scene
from throwcollect.sensing.view import View

_SUN = Pose.looking_at((4.0, -8.0, 12.0), (0.0, 0.0, 0.0)) * OPTICAL
"""Pose in world of a frame whose z is the direction of the light."""
_TO_SUN = (-_SUN.rows[0][2], -_SUN.rows[1][2], -_SUN.rows[2][2])
_AMBIENT, _FROM_SKY, _FROM_SUN = 0.38, 0.16, 0.46
"""Shares of the light that come from everywhere, from above, and from the sun."""
_FINEST_M, _MOST_CELLS = 0.01, 256
"""Size of a cell of the map of shadows, and the largest number of cells in a row of it."""
_BIAS_CELLS = 2.5
"""What is so many cells behind something lies in its shadow."""
_TILE_M = 0.5
_BRIGHT_TILE, _DARK_TILE, _SKY = (0.86, 0.87, 0.885), (0.80, 0.81, 0.83), (0.94, 0.96, 0.985)
_HAZE_M = 9.0
"""Half of the colour of the ground at this distance is that of the sky."""


@dataclass(frozen=True)
class Seen:
    """What pixels of a camera see.

    Attributes:
        view: Triangles in the optical frame.
        pixel: Size of a pixel over the focal length.
        x: Of the ray through each pixel, what it goes to the right over what it goes forward, shape ``(n,)``.
        y: The same downwards.
        depth: Distance along the optical axis [m]; inf if there is nothing.
        triangles: Number in `view` of the triangle that it sees; `NONE` if it sees the ground or nothing.
        on_ground: Whether it sees the ground.
    """

    view: View
    pixel: float
    x: Numbers
    y: Numbers
    depth: Numbers
    triangles: Integers
    on_ground: NDArray[np.bool_]

    def choose(self, chosen: Integers) -> Seen:
        """Choose some of the pixels."""
        return Seen(self.view, self.pixel, *(getattr(self, each)[chosen] for each in _PER_PIXEL))

    def find_places(self, pose: Pose) -> Iterator[Numbers]:
        """Find what the pixels see in a frame in which the optical one has a pose: x, y and z [m], each ``(n,)``."""
        depth = np.where(np.isfinite(self.depth), self.depth, 0)
        for (a, b, c), origin in zip(*pose, strict=True):
            yield depth * (a * self.x + b * self.y + c) + origin

    def find_labels(self, scene: Scene) -> NDArray[np.uint16]:
        """Find the number in `Scene.labels` of what each pixel sees, shape ``(n,)``."""
        labels = np.where(self.on_ground, scene.ground, 0).astype(np.uint16)
        pixels = np.flatnonzero(self.triangles != NONE)
        labels[pixels] = scene.labels_of[self.view.faces[self.triangles[pixels]]]
        return labels


_PER_PIXEL = ("x", "y", "depth", "triangles", "on_ground")


def shade(seen: Seen, placed: PlacedScene, optical: Pose, *, shadows: bool) -> NDArray[np.float32]:
    """Compute the colours of pixels: red, green and blue, from 0 to 255, shape ``(3, n)``."""
    direct = _find_light(seen, placed, optical) if shadows else np.ones(len(seen.depth), np.float32)
    color = _color_ground(seen, optical, direct)
    pixels = np.flatnonzero(seen.triangles != NONE)
    chosen = seen.choose(pixels)
    facing, up = _light(chosen, placed)
    light = _AMBIENT + _FROM_SKY * up + _FROM_SUN * np.maximum(facing, 0) * direct[pixels]
    color[:, pixels] = placed.scene.colors[:, seen.view.faces[chosen.triangles]] * light.astype(np.float32)
    result: NDArray[np.float32] = np.minimum(color, 1) * np.float32(255)
    return result


def _light(seen: Seen, placed: PlacedScene) -> tuple[Numbers, Numbers]:
    """Find, for pixels with triangles, how much the surface faces the sun, and how much it faces up: cosines."""
    used = np.zeros(len(seen.view.faces), bool)
    used[seen.triangles] = True
    number = np.cumsum(used)[seen.triangles] - 1
    view = seen.view.choose(used)
    edges, normals = view.find_edges(), placed.scene.normals[:, :, view.faces]
    a, b, c = (edges[0] + edges[1] + edges[2])[:, number]
    weight = a * seen.x + b * seen.y + c
    results = []
    for direction in (_TO_SUN, (0.0, 0.0, 1.0)):
        within = np.array([Pose(pose.inverse().rows).turn(direction) for pose in placed.poses])
        local = within.T[:, view.parts]
        cosines = [dot(normal, local) for normal in normals]
        a, b, c = (cosines[0] * edges[0] + cosines[1] * edges[1] + cosines[2] * edges[2])[:, number]
        results.append((a * seen.x + b * seen.y + c) / weight)
    return results[0], results[1]


def _color_ground(seen: Seen, optical: Pose, direct: NDArray[np.float32]) -> NDArray[np.float32]:
    """Compute the colours of the ground and of the sky behind it, shape ``(3, n_pixels)``."""
    depth = np.where(seen.on_ground, seen.depth, 1e4).astype(np.float32)
    east, north, _ = seen.find_places(optical)
    # A pixel that sees several tiles has their mean; seen from a small height, it is longer than wide.
    wide = depth * np.float32(seen.pixel)
    wide = wide * np.sqrt(depth) / np.float32(2 * math.sqrt(max(optical.origin[2], 0.01)))
    wave = [np.clip(_find_border(each) / wide, -1, 1) for each in (east, north)]
    is_dark = np.float32(0.5) - np.float32(0.5) * wave[0] * wave[1]
    haze = depth * depth / (depth * depth + np.float32(_HAZE_M * _HAZE_M))
    whole = _AMBIENT + _FROM_SKY + _FROM_SUN * _TO_SUN[2]
    light = np.float32((whole - _FROM_SUN * _TO_SUN[2]) / whole) + np.float32(_FROM_SUN * _TO_SUN[2] / whole) * direct
    result = np.empty((3, len(depth)), np.float32)
    for channel, (bright, dark, sky) in enumerate(zip(_BRIGHT_TILE, _DARK_TILE, _SKY, strict=True)):
        near = (np.float32(bright) + np.float32(dark - bright) * is_dark) * light
        result[channel] = near + (np.float32(sky) - near) * haze
    return result


def _find_border(at: Numbers) -> NDArray[np.float32]:
    """Find the distance of places from the nearest border of a tile [m], below 0 on every other tile."""
    double = at / (2 * _TILE_M)
    share = (double - np.floor(double)).astype(np.float32)
    result: NDArray[np.float32] = np.float32(2 * _TILE_M) * (np.float32(0.25) - np.abs(share - np.float32(0.5)))
    return result


@dataclass(frozen=True)
class ShadowMap:
    """How far from the sun the first surface is, in cells of a plane that the light falls on.

    Attributes:
        low: Where the map begins in the frame of the sun, x and y [m].
        cell_m: Edge of a cell.
        depth: Distance along the light [m], shape ``(rows, columns)``; inf where there is nothing.
    """

    low: tuple[float, float]
    cell_m: float
    depth: Numbers


@lru_cache(maxsize=2)
def _map_shadows(placed: PlacedScene) -> ShadowMap:
    """Look from the sun; cameras that see the same state share what is seen."""
    back = _SUN.inverse()
    pairs = zip(placed.poses, placed.scene.balls, strict=True)
    balls = [((back * pose).move(middle), radius) for pose, (middle, radius) in pairs if radius]
    low, high = (
        [pick(middle[axis] + sign * radius for middle, radius in balls) for axis in (0, 1)]
        for pick, sign in ((min, -1), (max, 1))
    )
    cell = max(_FINEST_M, (high[0] - low[0]) / _MOST_CELLS, (high[1] - low[1]) / _MOST_CELLS)
    width, height = (int((high[axis] - low[axis]) / cell) + 4 for axis in (0, 1))
    begin = low[0] - 1.5 * cell, low[1] - 1.5 * cell
    view = View.of(placed, _SUN, lambda *_: True, parallel=True)
    (a, b, c), axes = view.find_planes()[0], view.corners
    x, y = (axes[:, 0] - begin[0]) / cell, (axes[:, 1] - begin[1]) / cell
    c = np.minimum(c, -1e-30)
    right, down = -a / c * cell, -b / c * cell
    corner = axes[0, 2] - right * x[0] - down * y[0]
    farthest = float(axes[:, 2].max(initial=0.0)) + 1
    nearness = -right, -down, farthest - corner
    found = find_nearest(Outlines(x, y, np.arange(len(a))), nearness, width, height)
    cells = np.flatnonzero(found != NONE)
    row, column = np.divmod(cells, width)
    chosen = found[cells]
    depth = np.full(width * height, np.inf)
    depth[cells] = corner[chosen] + right[chosen] * (column + 0.5) + down[chosen] * (row + 0.5)
    return ShadowMap(begin, cell, depth.reshape(height, width))


def _find_light(seen: Seen, placed: PlacedScene, optical: Pose) -> NDArray[np.float32]:
    """Find which share of the sun's light reaches what each pixel sees, shape ``(n_pixels,)``."""
    shadows = _map_shadows(placed)
    x, y, z = seen.find_places(_SUN.inverse() * optical)
    column, row = (x - shadows.low[0]) / shadows.cell_m - 0.5, (y - shadows.low[1]) / shadows.cell_m - 0.5
    height, width = shadows.depth.shape
    inside = np.flatnonzero((column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1))
    column, row = column[inside], row[inside]
    left, top = column.astype(np.int64), row.astype(np.int64)
    right_share, down_share = column - left, row - top
    nearer = z[inside] - _BIAS_CELLS * shadows.cell_m
    flat, first = shadows.depth.ravel(), top * width + left
    one, two, three, four = ((flat[first + step] >= nearer) * 1.0 for step in (0, 1, width, width + 1))
    upper, lower = one + (two - one) * right_share, three + (four - three) * right_share
    light = np.ones(len(x), np.float32)
    light[inside] = upper + (lower - upper) * down_share
    return light
