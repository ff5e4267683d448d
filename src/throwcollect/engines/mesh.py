"""Triangle meshes of collision shapes, read in one way for every engine: STL and OBJ here, COLLADA by assimp."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError

Triangles = NDArray[np.float32]
"""Corners of triangles, shape ``(n_triangles, 3, 3)``, in the units of the file."""

STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A triangle in a binary STL file, which has a title of 80 bytes and the number of triangles before them."""

_LARGEST_COORDINATE = 1e6
_CELLS = 60
"""Cells of the grid of a coarse mesh along its longest edge: of 5 mm or less for a link of an arm."""
_LEAST_THICKNESS = 1e-6
"""Least extent of a solid in its thinnest direction, as a share of its extent in the longest."""

_HEADER, _RECORD = 84, 50
_METRES = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)")
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


@dataclass(frozen=True)
class Mesh:
    """The mesh in a file, which is read when its triangles are first needed."""

    path: Path

    @cached_property
    def triangles(self) -> Triangles:
        """The triangles of the file, at least one; all numbers are finite."""
        path = self.path
        if (read := _READERS.get(path.suffix.lower())) is None:
            expected = " or ".join(_READERS)
            raise ConfigError(f"{path}: collision meshes of this format cannot be read", expected=expected)
        try:
            triangles = read(path)
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read as a mesh: {error.strerror}") from error
        except (RuntimeError, ValueError, IndexError) as error:
            raise ConfigError(f"{path}: cannot be read as a mesh: {error}") from error
        if not len(triangles):
            raise ConfigError(f"{path}: a mesh without triangles")
        if not (np.abs(triangles) <= _LARGEST_COORDINATE).all():
            raise ConfigError(f"{path}: coordinates beyond {_LARGEST_COORDINATE:g}")
        return triangles

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Different corners in the order of their coordinates, shape ``(n_corners, 3)``, in the units of the file."""
        # Sorting columns is several times as fast as `np.unique`, which sorts rows.
        corners = self.triangles.reshape(-1, 3).astype(np.float64)
        corners = corners[np.lexsort(corners.T[::-1])]
        repeated = 1 + np.flatnonzero((corners[1:] == corners[:-1]).all(axis=1))
        return np.delete(corners, repeated, axis=0)

    @property
    def is_flat(self) -> bool:
        """Whether all corners lie in one plane, so that the mesh has no inside."""
        extents = np.linalg.svd(self.corners - self.corners.mean(axis=0), compute_uv=False)
        return bool(len(extents) < 3 or extents[2] <= _LEAST_THICKNESS * extents[0])

    def find_hull(self, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> pinocchio.coal.CollisionGeometry:
        """Compute the convex hull, as which the mesh collides in every engine, with coordinates times these factors."""
        if self.is_flat:
            raise ConfigError(f"{self.path}: the mesh is flat, so nothing can collide with it")
        points = pinocchio.coal.StdVec_Vec3s()
        points.extend(list(self.corners * scale))
        try:
            return pinocchio.coal.Convex.convexHull(points, True, "Qt")
        except RuntimeError as error:
            reason = str(error).splitlines()[-1]
            raise ConfigError(f"{self.path}: has no usable convex hull: {reason}") from error

    def encode(self) -> bytes:
        """Encode the triangles as binary STL."""
        return encode(self.triangles)

    def encode_coarse(self) -> bytes:
        """Encode a coarser mesh for viewers as binary STL: corners in one cell of a grid become one."""
        corners = self.triangles.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        cells = np.round((corners - low) / max(float((high - low).max()) / _CELLS, 1e-9)).astype(np.int64)
        # A number for each cell: sorting numbers is faster than sorting rows.
        _, first, number = np.unique(cells @ [1, 1 << 10, 1 << 20], return_index=True, return_inverse=True)
        one, two, three = first[number.reshape(-1, 3)].T
        keep = (one != two) & (two != three) & (three != one)
        return encode(corners[np.stack([one, two, three], axis=-1)[keep]])

    def encode_hull(self) -> bytes:
        """Encode the convex hull as binary STL."""
        hull = self.find_hull()
        corners = [[hull.polygons(index)[corner] for corner in range(3)] for index in range(hull.num_polygons)]
        return encode(np.asarray(hull.points(), np.float32)[corners])


def encode(triangles: Triangles) -> bytes:
    """Encode triangles as binary STL, with their normals: some viewers draw a mesh without them in black."""
    records = np.zeros(len(triangles), STL)
    records["corners"] = triangles
    one, two, three = np.moveaxis(records["corners"].astype(np.float64), 1, 0)
    normals = np.cross(two - one, three - one)
    x, y, z = normals.T
    # A triangle without an area has no normal.
    records["normal"] = normals / np.maximum(np.sqrt(x**2 + y**2 + z**2), 1e-30)[:, np.newaxis]
    return bytes(80) + len(records).to_bytes(4, "little") + records.tobytes()


def _read_stl(path: Path) -> Triangles:
    content = path.read_bytes()
    count = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    # The length tells a binary file, because some of them begin with `solid`, as all text files do.
    rest, is_text = len(content) - _HEADER - count * _RECORD, content.lstrip()[:5].lower() == b"solid"
    if len(content) >= _HEADER and (rest == 0 or (rest > 0 and not is_text)):
        corners: Triangles = np.frombuffer(content, STL, count, _HEADER)["corners"]
        return corners
    if not is_text or b"endsolid" not in content.lower():
        raise ValueError(f"{len(content)} bytes are no whole STL of {count} triangles, and no whole one in text")
    return np.array(_VERTEX.findall(content)).astype(np.float32).reshape(-1, 3, 3)


def _read_obj(path: Path) -> Triangles:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in path.read_bytes().splitlines():
        kind, *words = line.split() or [b""]
        if kind == b"v":
            x, y, z = words[:3]
            vertices.append([float(x), float(y), float(z)])
        elif kind == b"f":
            corners = [_find_index(int(word.partition(b"/")[0]), len(vertices)) for word in words]
            faces += [(corners[0], *pair) for pair in itertools.pairwise(corners[1:])]
    return np.array(vertices, np.float32).reshape(-1, 3)[np.array(faces, np.int64).reshape(-1, 3)]


def _find_index(number: int, vertices: int) -> int:
    """Find the index of a vertex: OBJ counts vertices from 1, or backwards from -1 for the last vertex so far."""
    index = number - 1 if number > 0 else vertices + number
    if not (number and 0 <= index < vertices):
        raise ValueError(f"a face uses vertex {number} of {vertices}")
    return index


def _read_collada(path: Path) -> Triangles:
    """Read COLLADA with its unit, and without its upward axis, as viewers of ROS do."""
    model = pinocchio.coal.MeshLoader(pinocchio.coal.BV_OBB).load(str(path), np.ones(3))
    triangles = (model.tri_indices(index) for index in range(model.num_tris))
    numbers = [[triangle[corner] for corner in range(3)] for triangle in triangles]
    # The library leaves out the transformation of the root, and with it the unit.
    unit = _METRES.search(path.read_bytes())
    corners: Triangles = np.asarray(model.vertices(), np.float32)[numbers] * np.float32(unit[1] if unit else 1)
    return corners


_READERS = {".stl": _read_stl, ".obj": _read_obj, ".dae": _read_collada}
