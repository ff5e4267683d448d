"""Triangles of drawn shapes: boxes, cylinders and spheres of their own, and meshes, which are made coarser."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.mesh import Mesh
from throwcollect.engines.pose import Pose
from throwcollect.sensing.decimation import Faces, Points, cross, decimate, dot, weld
from throwcollect.sensing.drawn_robot import DrawnShape
from throwcollect.sensing.raster import spread

COARSE = 12_000
"""Triangles of all meshes together that are enough for pictures of 640 by 480 pixels."""
_WELD_M = 1e-4
_SIDES = 48
_SMOOTH = 0.77
"""Cosine of the largest angle between triangles whose common edge looks round."""


@dataclass(frozen=True)
class Surface:
    """Triangles of a body.

    Attributes:
        corners: In the frame of the body [m], shape ``(3, n_corners)``.
        faces: Numbers of corners, counter-clockwise as seen from outside, shape ``(3, n_faces)``.
        normals: Unit vector at each corner of each triangle, with edges that look round, shape ``(3, 3, n_faces)``:
            corner, axis, triangle.
    """

    corners: Points
    faces: Faces
    normals: NDArray[np.float64]

    @classmethod
    def of(cls, corners: Points, faces: Faces) -> Surface:
        """Find the normals of triangles."""
        return cls(corners, faces, _find_normals(corners, faces))

    def place(self, pose: Pose, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> Surface:
        """Give the same surface with coordinates times these factors, at a pose."""
        x, y, z = scale
        corners = self.corners * np.array([[x], [y], [z]])
        # Normals scale inversely; those of mirrored triangles, whose corners go round the other way, do not change.
        normals = self.normals / np.array([[[x], [y], [z]]])
        length = np.sqrt(normals[:, 0] ** 2 + normals[:, 1] ** 2 + normals[:, 2] ** 2)[:, np.newaxis]
        # A triangle without an area has no normal.
        turned = np.stack([rotate(pose, each) for each in normals / np.maximum(length, 1e-30)])
        order = [0, 1, 2] if x * y * z > 0 else [0, 2, 1]
        return Surface(rotate(pose, corners) + np.reshape(pose.origin, (3, 1)), self.faces[order], turned[order])


def rotate(pose: Pose, vectors: Points) -> Points:
    """Write directions in a frame along the axes of its parent."""
    x, y, z = vectors
    return np.stack([a * x + b * y + c * z for a, b, c in pose.rows])


def _find_normals(corners: Points, faces: Faces) -> NDArray[np.float64]:
    """Add up, at each corner of a triangle, the normals of those triangles around it that are nearly as steep."""
    a, b, c = (corners[:, each] for each in faces)
    wide = cross(b - a, c - a)
    own = wide / np.maximum(np.sqrt(dot(wide, wide)), 1e-30)
    count, corner = faces.shape[1], faces.ravel()
    # Each corner of a triangle is paired with all triangles around it.
    order = np.argsort(corner, kind="stable")
    around = np.bincount(corner, minlength=corners.shape[1])
    begins = np.cumsum(around) - around
    pair, step = spread(around[corner])
    other = order[begins[corner[pair]] + step] % count
    near = dot(own[:, pair % count], own[:, other]) > _SMOOTH
    sums = [np.bincount(pair[near], axis[other[near]], 3 * count) for axis in wide]
    total: Points = np.stack(sums).astype(np.float64)
    length = np.sqrt(dot(total, total))
    normals = np.where(length > 0, total / np.maximum(length, 1e-30), np.tile(own, 3))
    return normals.reshape(3, 3, count).transpose(1, 0, 2)


def surfaces_of(shapes: Sequence[DrawnShape], files: Mapping[str, Path], most: int) -> list[Surface]:
    """Make the surface of each shape in the frame of its link.

    Args:
        shapes: The shapes.
        files: Files of meshes, by their paths or URLs in the description.
        most: Largest number of triangles of all meshes together.
    """
    uses = [(files[each.mesh], _size_of(each)) for each in shapes if each.kind == "mesh"]
    meshes = dict(zip(dict.fromkeys(uses), _read_meshes(tuple(uses), most), strict=True))
    surfaces = []
    for shape in shapes:
        pose = Pose.of(shape.position, shape.rotation_xyzw)
        if shape.kind == "mesh":
            mirrored = [math.copysign(1.0, factor) for factor in shape.size]
            surfaces.append(meshes[files[shape.mesh], _size_of(shape)].place(pose, mirrored))
        else:
            surfaces.append(_SOLIDS[shape.kind]().place(pose, shape.size))
    return surfaces


def _size_of(shape: DrawnShape) -> tuple[float, ...]:
    return tuple(map(abs, shape.size))


@lru_cache(maxsize=8)
def _read_meshes(uses: tuple[tuple[Path, tuple[float, ...]], ...], most: int) -> list[Surface]:
    """Read meshes and make them coarser together, so that triangles are left where they are needed."""
    corners, faces, begins, enlarged = [], [], [0], []
    for path, scale in dict.fromkeys(uses):
        triangles = Mesh(path).triangles
        points = triangles.reshape(-1, 3).T.astype(np.float64) * np.reshape(scale, (3, 1))
        points, welded = weld(points, np.arange(triangles.size // 3).reshape(-1, 3).T, _WELD_M)
        # None has a large share of all, and so many at once would need much memory.
        points, welded = _drop_unused(*decimate(points, welded, most // 6))
        # Small parts, such as fingers, are enlarged meanwhile, because they matter more than their size.
        enlarged.append(math.sqrt(1 / max(float((points.max(axis=1) - points.min(axis=1)).max()), _WELD_M)))
        corners.append(points * enlarged[-1])
        faces.append(welded + begins[-1])
        begins.append(begins[-1] + points.shape[1])
    if not corners:
        return []
    # The same mesh may be drawn several times, such as at the left and at the right.
    share = len(corners) / len(uses)
    points, chosen = decimate(np.concatenate(corners, axis=1), np.concatenate(faces, axis=1), int(most * share))
    surfaces = []
    for begin, end, factor in zip(begins, begins[1:], enlarged, strict=False):
        own = chosen[:, (chosen[0] >= begin) & (chosen[0] < end)]
        used, own = _drop_unused(points, own)
        surfaces.append(Surface.of(used / factor, own))
    return surfaces


def _drop_unused(corners: Points, faces: Faces) -> tuple[Points, Faces]:
    """Drop the corners that no triangle has."""
    used, number = np.unique(faces, return_inverse=True)
    return corners[:, used], number.reshape(faces.shape)


@cache
def _make_box() -> Surface:
    """Make a cube with edges of 1."""
    corners = np.array(list(product([-0.5, 0.5], repeat=3))).T
    # Each row goes round a side.
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    return Surface.of(corners, np.array(faces).T)


def _make_circle() -> list[tuple[float, float]]:
    """Make a polygon that has the area of a circle with a diameter of 1."""
    step = 2 * math.pi / _SIDES
    radius = 0.5 * math.sqrt(step / math.sin(step))
    return [(radius * math.cos(step * k), radius * math.sin(step * k)) for k in range(_SIDES)]


@cache
def _make_cylinder() -> Surface:
    """Make a cylinder along z with a diameter and a length of 1."""
    circle, count = _make_circle(), _SIDES
    corners = [(x, y, z) for z in (-0.5, 0.5) for x, y in circle] + [(0, 0, -0.5), (0, 0, 0.5)]
    faces = []
    for one in range(count):
        two = (one + 1) % count
        faces += [(one, two, count + two), (one, count + two, count + one)]
        faces += [(2 * count, two, one), (2 * count + 1, count + one, count + two)]
    return Surface.of(np.array(corners).T, np.array(faces).T)


@cache
def _make_sphere() -> Surface:
    """Make a sphere with a diameter of 1, by halving the edges of an octahedron."""
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64).T
    faces = np.array([(k, (k + 1) % 4, 4) for k in range(4)] + [((k + 1) % 4, k, 5) for k in range(4)]).T
    for _ in range(4):
        size = corners.shape[1]
        start, end = faces.ravel(), faces[[1, 2, 0]].ravel()
        edges, number = np.unique(np.minimum(start, end) * size + np.maximum(start, end), return_inverse=True)
        middle = corners[:, edges // size] + corners[:, edges % size]
        corners = np.concatenate([corners, middle / np.sqrt(dot(middle, middle))], axis=1)
        a, b, c = faces
        ab, bc, ca = number.reshape(3, -1) + size
        faces = np.concatenate([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]], axis=1)
    return Surface.of(corners / 2, faces)


_SOLIDS = {"box": _make_box, "cylinder": _make_cylinder, "sphere": _make_sphere}
