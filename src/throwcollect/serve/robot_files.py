"""What browsers draw a robot from: its description, and the files of its meshes."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from throwcollect.config.loader import load
from throwcollect.dataset.directory import config_path
from throwcollect.errors import NotFoundError
from throwcollect.members import load_member, names_of
from throwcollect.robots.description import full_description
from throwcollect.robots.robot import Robot
from throwcollect.runs.records import Run


def description_of(run: Run) -> str:
    """URDF of the robot of a run, with its tool; meshes are ``package://`` URLs.

    Raises:
        NotFoundError: If the run has no configuration yet.
        ConfigError: If the robot's files cannot be read.
    """
    path = config_path(Path(run.record.directory))
    if not path.is_file():
        raise NotFoundError(f"run {run.id} has no configuration yet")
    return _describe(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=16)
def _describe(path: Path, _changed_ns: int) -> str:
    return full_description(load(path))


def find_mesh(package: str, path: str) -> Path:
    """The file of a mesh of one of the robots.

    Args:
        package: Name of the package in its URL.
        path: Path within the package.

    Raises:
        NotFoundError: If no robot has such a package, or it has no such file.
    """
    # What no file can be called.
    with suppress(OSError, ValueError):
        for share in _shares():
            root = (share / package).resolve()
            file = (root / path).resolve()
            # Neither dots nor links lead out of the package.
            if root.parent == share and file.is_relative_to(root) and file.is_file():
                return file
    raise NotFoundError(f"no mesh package://{package}/{path}")


@lru_cache(maxsize=1)
def _shares() -> tuple[Path, ...]:
    robots: list[Robot] = [load_member("robots", name) for name in names_of("robots")]
    return tuple(dict.fromkeys(robot.share().resolve() for robot in robots))
