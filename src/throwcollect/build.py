"""What computes here, as one digest: sources, physics engine, robot model, compression.

Two processes with the same digest compute the same episodes, so a coordinator takes those of such simulations alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from pathlib import Path

import rclzenoh

_PACKAGES = {"pybullet": "pybullet", "example-robot-data": None, "zstandard": None}
"""Packages whose versions count, and the compiled module of the one that simulates."""
_SOURCES = (".py", ".msg", ".srv", ".action", ".json")


@cache
def build_digest() -> str:
    """SHA-256, in hexadecimal, over the installed sources, and over versions of engine, model and added packages."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    # The ROS client lays out the messages of an episode.
    packages = (Path(__file__).parent, Path(rclzenoh.__file__).parent)
    for path in sorted(path for package in packages for path in package.rglob("*") if path.suffix in _SOURCES):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode() + content)
    for fact in _facts():
        digest.update(fact.encode() + b"\n")
    return digest.hexdigest()


def _facts() -> Iterator[str]:
    for package, module in _PACKAGES.items():
        try:
            yield f"{package} {version(package)}"
        except PackageNotFoundError:
            yield f"{package} without version"
        if module is not None:
            # Two compilations of one version differ in size. Its hash would take each node a second: it has 140 MB.
            found = find_spec(module)
            path = Path(found.origin) if found and found.origin else None
            yield f"{module} {path.stat().st_size if path and path.exists() else 'missing'} bytes"
    # Robots, tools, engines and tasks of other packages.
    for group in sorted(group for group in entry_points().groups if group.startswith("throwcollect.")):
        for point in sorted(entry_points(group=group), key=lambda point: point.name):
            package = f"{point.dist.name} {point.dist.version}" if point.dist else "an unknown package"
            yield f"{group} {point.name}: {point.value} of {package}"
