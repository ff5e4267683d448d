"""The description of the robot of a run, and the files of its meshes, for browsers that draw it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath

from throwcollect.collect.runs.component_container import DESCRIPTION
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.config.loader import load
from throwcollect.dataset.carried_robot import list_carried
from throwcollect.dataset.directory import config_path
from throwcollect.errors import NotFoundError
from throwcollect.members import load_member, usable_names
from throwcollect.robots.appearance import read_urdf_text
from throwcollect.robots.description import full_description
from throwcollect.robots.robot import Robot
from throwcollect.robots.surroundings import BodyLook, looks_of

_MESH = re.compile(r"package://([\w.-]+)/([^\"'<>]+)")
"""URL of a mesh in a description: its package, and its path in that package."""
_carried: dict[str, Path] = {}
"""Files of robots that datasets of runs carry, by their names without ending."""


def description_of(run: Run) -> str:
    """URDF of the robot of a run, with its tool; meshes are ``package://`` URLs."""
    if run.record.kind == "container":
        path = run.record.directory / DESCRIPTION
        if not path.is_file():
            raise NotFoundError(f"run {run.id}: its component has no urdf")
        return read_urdf_text(path)
    return full_description(load(_find_config(run)))


@dataclass(frozen=True)
class SceneFacts:
    """What viewers have to know of the scene of a run.

    Attributes:
        base_height_m: Height of the robot's fixed base above the ground [m].
        mount_height_m: Height of the mount below it [m]; 0 if the robot stands on feet of its own.
        landing_height_m: Height of the plane in which throws land [m]; None if that varies.
        target_distance_m: Least and greatest distance from the robot's base at which throws are to land [m]; None
            without such a target.
        bodies: Bodies of scene and task; a trial in which they differ has bodies of its own.
    """

    base_height_m: float
    mount_height_m: float
    landing_height_m: float | None
    target_distance_m: tuple[float, float] | None
    bodies: tuple[BodyLook, ...]


def scene_of(run: Run) -> SceneFacts:
    """Read the scene of a run."""
    config = load(_find_config(run))
    varies = "scene.landing_height_m" in config.sweep.parameters
    distance = None if config.sweep.target is None else config.sweep.target.distance_m
    return SceneFacts(
        config.robot.base_height_m,
        config.robot.mount_height_m,
        None if varies else config.scene.landing_height_m,
        None if distance is None else (distance.min, distance.max),
        looks_of(config),
    )


def _find_config(run: Run) -> Path:
    """File of the configuration of a run."""
    path = config_path(run.record.directory)
    if not path.is_file():
        raise NotFoundError(f"run {run.id} has no configuration yet")
    return path


def find_mesh(package: str, path: str) -> Path:
    """Find the file of a mesh of one of the robots, whose URL is ``package://PACKAGE/PATH``."""
    root = _find_packages().get(package)
    # Neither dots nor links may lead out of the package. A path that no file can have raises an error.
    with suppress(OSError, ValueError):
        if root is not None and ".." not in PurePosixPath(path).parts:
            file = (root / path).resolve(strict=True)
            if file.is_relative_to(root.resolve()) and file.is_file():
                return file
    if root is None and (found := _find_carried(path.partition(".")[0])) is not None and found.name == path:
        return found
    raise NotFoundError(f"no mesh package://{package}/{path}")


def _find_carried(stem: str) -> Path | None:
    """Find a mesh that a dataset of a run carries, by its name without ending, which is made of its content."""
    if stem not in _carried or not _carried[stem].is_file():
        for run in Records().all():
            with suppress(OSError):
                directory = run.record.directory.resolve(strict=True)
                # A link may lead out of the directory.
                files = (directory / name for name in list_carried(directory))
                _carried.update({file.stem: file for file in files if file.resolve() == file})
    return _carried.get(stem)


@dataclass(frozen=True)
class MeshFile:
    """The file of a mesh that a description names.

    Attributes:
        url: Its URL in the description: ``package://PACKAGE/PATH``.
        sha256: SHA-256 of its content, in hexadecimal.
        bytes: Its size.
    """

    url: str
    sha256: str
    bytes: int


def list_meshes(description: str) -> list[MeshFile]:
    """List the files of meshes that a description (URDF text) names, without those of packages that no robot has."""
    return [
        MeshFile(f"package://{package}/{path}", _digest(file, stat.st_mtime_ns), stat.st_size)
        for package, path, file in _find_files(description)
        for stat in [file.stat()]
    ]


def find_mesh_by_content(sha256: str) -> Path:
    """Find the file of a mesh of one of the robots by the SHA-256 of its content, in hexadecimal."""
    known = [file for text, _ in _read_descriptions() for _, _, file in _find_files(text)]
    carried = _find_carried(sha256[:16])
    for file in [*known, *([carried] if carried else [])]:
        if _digest(file, file.stat().st_mtime_ns) == sha256:
            return file
    raise NotFoundError(f"no mesh with the SHA-256 {sha256}")


def _find_files(description: str) -> Iterator[tuple[str, str, Path]]:
    """Find the mesh files that a description names, each with its package and its path in that package."""
    for package, path in dict.fromkeys(_MESH.findall(description)):
        with suppress(NotFoundError):
            yield package, path, find_mesh(package, path)


@lru_cache(maxsize=1024)
def _digest(file: Path, _changed_ns: int) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@lru_cache(maxsize=1)
def _find_packages() -> Mapping[str, Path]:
    """Directories of the packages that the descriptions of installed robots name, by their names."""
    return {
        package: robot.directory / package for text, robot in _read_descriptions() for package, _ in _MESH.findall(text)
    }


@lru_cache(maxsize=1)
def _read_descriptions() -> Sequence[tuple[str, Robot]]:
    """Read the installed descriptions that need no import."""
    robots = (load_member("robots", name) for name in usable_names("robots"))
    return [(read_urdf_text(robot.urdf_path), robot) for robot in robots if isinstance(robot, Robot)]
