"""Computes one digest over everything that computes episodes: sources, physics engine, robot model, compression.

Two processes with the same digest compute the same episodes. A coordinator takes only episodes with its own digest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from pathlib import Path

import rclzenoh
from throwcollect.engine_packages import PACKAGES

_PACKAGES = ("example-robot-data", "zstandard")
"""Packages whose versions count for every engine."""
_SOURCES = (".py", ".msg", ".srv", ".action", ".json")


@cache
def build_digest(engine: str) -> str:
    """Hash the installed sources, and versions of engine, model and added packages; SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    # The ROS client counts, too, because it lays out the messages of an episode.
    packages = (Path(__file__).parent, Path(rclzenoh.__file__).parent)
    for path in sorted(path for package in packages for path in package.rglob("*") if path.suffix in _SOURCES):
        content = path.read_bytes()
        # Each file's name and length come before its bytes, so bytes cannot move from one file to the next unnoticed.
        digest.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode() + content)
    for fact in _list_facts(engine):
        digest.update(fact.encode() + b"\n")
    return digest.hexdigest()


def _list_facts(engine: str) -> Iterator[str]:
    for distribution in _PACKAGES:
        yield _version_of(distribution)
    if engine in PACKAGES:
        package = PACKAGES[engine]
        yield _version_of(package.distribution)
        # Two builds of one version differ in size. Hashing would take each node a second, because Bullet has 140 MB.
        found = find_spec(package.module)
        beside = Path(found.origin).parent.glob(package.compiled) if found and found.origin else []
        sizes = [path.stat().st_size for path in sorted(beside)]
        yield f"{package.module} {sizes or 'missing'} bytes"
    # Other packages may add robots, tools, engines and tasks.
    for group in sorted(group for group in entry_points().groups if group.startswith("throwcollect.")):
        for point in sorted(entry_points(group=group), key=lambda point: point.name):
            owner = f"{point.dist.name} {point.dist.version}" if point.dist else "an unknown package"
            yield f"{group} {point.name}: {point.value} of {owner}"


def _version_of(distribution: str) -> str:
    try:
        return f"{distribution} {version(distribution)}"
    except PackageNotFoundError:
        return f"{distribution} without version"
