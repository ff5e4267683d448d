"""Computes one digest over everything that computes episodes: sources, physics engine, robot model, compression.

Two processes with the same digest compute the same episodes. A coordinator takes only episodes with its own digest.
Other packages count only if they bring a part that computes, so machines with different packages can share a run.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import rclzenoh
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.members import list_origins

_PACKAGES = ("example-robot-data", "zstandard")
"""Packages whose versions count for every engine."""
_SOURCES = (".py", ".msg", ".srv", ".action", ".json")


@cache
def build_digest(engine: str, robot: str = "talos", tool: str = "spoon", task: str = "throw", policy: str = "") -> str:
    """Hash the installed sources, and versions of the packages of these parts; SHA-256, in hexadecimal.

    Of a policy ``module:function``, the file of the module counts.
    """
    digest = hashlib.sha256(_hash_sources())
    for fact in _list_facts(engine, robots=robot, tools=tool, tasks=task):
        digest.update(fact.encode() + b"\n")
    if policy:
        facts = [_hash_module(policy.partition(":")[0])] if ":" in policy else list_origins("policies", policy)
        digest.update("\n".join([policy, *facts]).encode())
    return digest.hexdigest()


@cache
def _hash_sources() -> bytes:
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    # The ROS client counts, too, because it lays out the messages of an episode.
    packages = (Path(__file__).parent, Path(rclzenoh.__file__).parent)
    for path in sorted(path for package in packages for path in package.rglob("*") if path.suffix in _SOURCES):
        content = path.read_bytes()
        # Each file's name and length come before its bytes, so bytes cannot move from one file to the next unnoticed.
        digest.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.digest()


def _list_facts(engine: str, **others: str) -> Iterator[str]:
    """List what counts besides the sources: of an engine, and of members of other families, by family."""
    for distribution in _PACKAGES:
        yield _version_of(distribution)
    if engine in ENGINE_PACKAGES:
        package = ENGINE_PACKAGES[engine]
        yield _version_of(package.distribution)
        # Two builds of one version differ in size. Hashing would take each node a second, because Bullet has 140 MB.
        found = find_spec(package.module)
        files = Path(found.origin).parent.glob(package.compiled) if found and found.origin else []
        sizes = [path.stat().st_size for path in sorted(files)]
        yield f"{package.module} {sizes or 'missing'} bytes"
    for family, name in {"engines": engine, **others}.items():
        yield from list_origins(family, name)


def _hash_module(module: str) -> str:
    try:
        found = find_spec(module)
        return hashlib.sha256(Path(found.origin or "").read_bytes()).hexdigest() if found else "missing"
    except (ImportError, OSError, ValueError):
        return "missing"


def _version_of(distribution: str) -> str:
    try:
        return f"{distribution} {version(distribution)}"
    except PackageNotFoundError:
        return f"{distribution} without version"
