"""Finds the files of a robot's description: in a package of ROS or of example-robot-data, or by a path."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import MissingExtraError
from throwcollect.files import suggest_path
from throwcollect.robots.urdf import PACKAGE, locate_mesh

_EXAMPLES = "example-robot-data:"
_MOST_MESH_BYTES = 50_000_000
"""As many as a million triangles have in a binary STL."""


def make_error(key: str, sentence: str, hint: str | None = None) -> ConfigError:
    """Make the error of a key of the section `robot`; an empty key is the section itself."""
    return ConfigError([Problem(sentence, f"robot.{key}" if key else "robot")], hint=hint)


def find_urdf(urdf: str) -> Path:
    """Find the file that the key `robot.urdf` names."""
    if urdf.startswith(_EXAMPLES):
        path = _find_examples() / urdf.removeprefix(_EXAMPLES)
    elif urdf.startswith(PACKAGE):
        package, _, rest = urdf.removeprefix(PACKAGE).partition("/")
        path = next((share / rest for share in _list_shares(package)), Path(urdf))
    else:
        path = Path(urdf)
    if not path.is_file():
        wrong = "is a directory" if path.is_dir() else "no such file"
        near = "" if path.is_dir() or ":" in urdf else suggest_path(path)
        where = path if path.is_absolute() else urdf
        raise make_error("urdf", f"{where}: {wrong}{near}", hint="docs/robots.md says how a robot is described")
    return path


def find_mesh(filename: str, urdf: Path, packages: Mapping[str, str]) -> Path:
    """Find the file of a mesh that a URDF names, and make sure that it is not too large.

    Args:
        filename: Path or URL of the mesh.
        urdf: File of the URDF.
        packages: Directories of packages, by name.
    """
    if filename.startswith(PACKAGE):
        package, _, rest = filename.removeprefix(PACKAGE).lstrip("/").partition("/")
        places = [Path(given) for name, given in packages.items() if name == package]
        # A package is a directory of its name, mostly one of those that the URDF lies in.
        places += [above / package for above in urdf.resolve().parents]
        places += [above for above in urdf.resolve().parents if above.name == package]
        places += _list_shares(package)
        # The meshes of an imported robot lie in the directory of its URDF.
        found = next((place / rest for place in places if (place / rest).is_file()), urdf.parent / rest)
        missing = f"not found; robot.packages takes the directory of {package}"
    else:
        found = locate_mesh(filename, urdf.parent, urdf.parent)
        missing = f"there is no file {found}"
    if not found.is_file():
        raise ConfigError(f"{filename}: {missing}")
    if (size := found.stat().st_size) > _MOST_MESH_BYTES:
        most = f"at most {_MOST_MESH_BYTES // 10**6} MB, which is a million triangles of STL"
        raise ConfigError(f"{found}: should have {most}, has {size // 10**6} MB")
    return found


def _find_examples() -> Path:
    try:
        return Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    except PackageNotFoundError as error:
        raise MissingExtraError("example-robot-data", "collect") from error


def _list_shares(package: str) -> Iterator[Path]:
    """List the directories in which ROS has installed a package, by the environment."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix and (share := Path(prefix, "share", package)).is_dir():
            yield share
