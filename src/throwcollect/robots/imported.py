"""Robots that have been imported: a directory of files, and the section of a configuration that belongs to it."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache, partial
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.engines.body import Placement
from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import MissingExtraError
from throwcollect.robots.robot import Robot
from throwcollect.robots.urdf import PACKAGE, as_vector, locate_mesh

URDF, SRDF = "robot.urdf", "robot.srdf"
"""Names of an imported robot's files; its meshes have names made of their digests."""
HOME = "home"
"""Name of the posture at rest in the SRDF of an imported robot."""
_NAME = 16
"""Length of the names of meshes."""
_MOST_MESH_BYTES = 50_000_000
"""As many as a million triangles have in a binary STL."""
_KEYS = {"name", "urdf", "srdf", "flange", "tool_pose", "controllers", "prismatic", "holding", "sha256"}
"""Keys that the robot depends on."""


def make_robot(section: DescribedRobotConfig) -> Robot:
    """Make the robot of a complete section."""
    return _make_robot(section.model_dump_json(include=_KEYS))


# Robots are keys of caches, so that equal sections need to have the same one.
@lru_cache(maxsize=16)
def _make_robot(keys: str) -> Robot:
    section = DescribedRobotConfig.model_validate_json(keys)
    controllers = section.controllers or {}
    return Robot(
        name=section.name,
        title=section.name,
        controllers={name: tuple(joints) for name, joints in controllers.items() if isinstance(joints, list)},
        share=partial(_check_directory, Path(section.urdf).parent, section.sha256),
        package=package_of(section.name),
        urdf=URDF,
        srdf=SRDF,
        rest=HOME,
        hand=section.flange,
        tool_pose=Placement(as_vector(section.tool_pose.position_m), as_vector(section.tool_pose.rpy_rad)),
        holding=tuple(section.holding or ()),
        sliding=frozenset(section.prismatic),
    )


def package_of(name: str) -> str:
    """Name the package of ``package://`` URLs in the description of an imported robot."""
    return f"{name.replace('-', '_')}_description"


def list_files(directory: Path) -> list[Path]:
    """List the files of an imported robot that its description needs, by name."""
    return sorted(path for path in directory.iterdir() if path.name in (URDF, SRDF) or len(path.stem) == _NAME)


def hash_files(directory: Path) -> str:
    """Hash the files of an imported robot with their names; SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    for path in list_files(directory):
        content = path.read_bytes()
        digest.update(f"{path.name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


@lru_cache(maxsize=16)
def _check_directory(directory: Path, sha256: str | None) -> Path:
    """Make sure that the files of a robot are those that its section was written for; None is any files."""
    try:
        found = hash_files(directory) if sha256 else sha256
    except OSError as error:
        raise ConfigError(f"{directory}: the files of the robot cannot be read: {error.strerror}") from error
    if found != sha256:
        raise ConfigError(
            f"{directory}: the files of the robot are not those of robot.sha256",
            hint="import the robot again, or restore a dataset by throwcollect up CONFIG --resume DIR",
        )
    return directory


# Every mesh needs this, and it takes a third of a millisecond.
@cache
def find_examples() -> Path:
    """Find the directory in which example-robot-data is installed."""
    try:
        return Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError as error:
        raise MissingExtraError("example-robot-data") from error


def list_shares(package: str) -> Iterator[Path]:
    """List the directories in which ROS has installed a package, by the environment."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix and (share := Path(prefix, "share", package)).is_dir():
            yield share


def find_mesh(filename: str, urdf: Path, packages: Mapping[str, str] | None = None) -> Path:
    """Find the mesh that a URDF names; packages lie in given directories, above it, or in ROS."""
    if filename.startswith(PACKAGE):
        package, _, rest = filename.removeprefix(PACKAGE).lstrip("/").partition("/")
        places = [Path(given) for name, given in (packages or {}).items() if name == package]
        # A package is a directory of its name, mostly one of those that the URDF lies in.
        places += [above / package for above in urdf.resolve().parents]
        places += [above for above in urdf.resolve().parents if above.name == package]
        places += list_shares(package)
        # The meshes of an imported robot lie in the directory of its URDF.
        found = next((place / rest for place in places if (place / rest).is_file()), urdf.parent / rest)
        missing = "not found" if packages is None else f"not found; robot.packages takes the directory of {package}"
    else:
        found = locate_mesh(filename, urdf.parent, urdf.parent)
        missing = f"there is no file {found}"
    if not found.is_file():
        raise ConfigError(f"{filename}: {missing}")
    if (size := found.stat().st_size) > _MOST_MESH_BYTES:
        most = f"at most {_MOST_MESH_BYTES // 10**6} MB, which is a million triangles of STL"
        raise ConfigError(f"{found}: should have {most}, has {size // 10**6} MB")
    return found


def make_error(key: str, sentence: str, hint: str | None = None) -> ConfigError:
    """Make the error that a key of the section `robot` is wrong."""
    return ConfigError([Problem(sentence, f"robot.{key}" if key else "robot")], hint=hint)
