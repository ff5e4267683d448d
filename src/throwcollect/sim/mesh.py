"""Reads triangle meshes of collision shapes, and checks them, because Bullet's own readers crash on broken files."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.engine import STL
from throwcollect.errors import RequestError

Triangles = NDArray[np.float32]
"""Corners of triangles, shape ``(n_triangles, 3, 3)``, in the units of the file."""

_LARGEST_FILE = 32 * 2**20
_LARGEST_COORDINATE = 1e6
_HEADER, _RECORD = 84, 50
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_mesh(path: Path) -> Triangles:
    """Read at least one triangle of an STL file, binary or text, or of an OBJ file; all numbers are finite.

    Raises:
        RequestError: ``MISSING_ASSETS`` if there is no such file, ``UNSUPPORTED_ASSETS`` if it has another format, is
            too large or is broken.
    """
    check_mesh(path)
    read = _read_stl if path.suffix.lower() == ".stl" else _read_obj
    try:
        triangles = read(path.read_bytes())
    except OSError as error:
        raise RequestError("MISSING_ASSETS", f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, IndexError) as error:
        raise RequestError("UNSUPPORTED_ASSETS", f"{path}: broken mesh: {error}") from error
    if not len(triangles):
        raise RequestError("UNSUPPORTED_ASSETS", f"{path}: a mesh without triangles")
    if not (np.abs(triangles) <= _LARGEST_COORDINATE).all():
        raise RequestError("UNSUPPORTED_ASSETS", f"{path}: coordinates beyond {_LARGEST_COORDINATE:g}")
    return triangles


def check_mesh(path: Path) -> None:
    """Check a mesh as far as that is possible without reading it.

    Raises:
        RequestError: ``MISSING_ASSETS`` if there is no such file, ``UNSUPPORTED_ASSETS`` if it has another format or is
            too large.
    """
    try:
        size = path.stat().st_size if path.is_file() else None
    except (OSError, ValueError) as error:
        raise RequestError("MISSING_ASSETS", f"{path!s:.255}: cannot be read: {error}") from error
    if size is None:
        raise RequestError("MISSING_ASSETS", f"{path!s:.255}: no such file")
    if path.suffix.lower() not in (".stl", ".obj"):
        raise RequestError(
            "UNSUPPORTED_ASSETS", f"{path}: collision meshes of this format cannot be read", expected="stl or obj"
        )
    if size > _LARGEST_FILE:
        raise RequestError("UNSUPPORTED_ASSETS", f"{path}: {size} bytes; at most {_LARGEST_FILE}")


def _read_stl(content: bytes) -> Triangles:
    count = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    # The length tells a binary file, because some of them begin with `solid`, as all text files do.
    if len(content) >= _HEADER and len(content) == _HEADER + count * _RECORD:
        corners: Triangles = np.frombuffer(content, STL, count, _HEADER)["corners"]
        return corners
    if not content.lstrip().startswith(b"solid"):
        raise ValueError(f"{len(content)} bytes are no STL of {count} triangles")
    return np.array(_VERTEX.findall(content)).astype(np.float32).reshape(-1, 3, 3)


def _read_obj(content: bytes) -> Triangles:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in content.splitlines():
        kind, *words = line.split() or [b""]
        if kind == b"v":
            x, y, z = words[:3]
            vertices.append([float(x), float(y), float(z)])
        elif kind == b"f":
            corners = [_find_index(int(word.partition(b"/")[0]), len(vertices)) for word in words]
            faces += [(corners[0], *pair) for pair in itertools.pairwise(corners[1:])]
    return np.array(vertices, np.float32).reshape(-1, 3)[np.array(faces, np.int64).reshape(-1, 3)]


def _find_index(number: int, vertices: int) -> int:
    """Find the index of a vertex: OBJ counts vertices from 1, or backwards from -1 for the last vertex so far.

    Raises:
        ValueError: If there is no such vertex.
    """
    index = number - 1 if number > 0 else vertices + number
    if not (number and 0 <= index < vertices):
        raise ValueError(f"a face uses vertex {number} of {vertices}")
    return index
