"""What computes here, as one digest: sources, physics engine, robot model, compression.

Two processes with the same digest compute the same episodes, so a coordinator takes those of such simulations alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

_PACKAGES = {"pybullet": "pybullet", "example-robot-data": None, "zstandard": None}
"""Packages whose versions count, and the compiled module of the one that simulates."""
_SOURCES = (".py", ".msg", ".srv", ".action")


@cache
def build_digest() -> str:
    """SHA-256, in hexadecimal, over the installed sources, and over versions and sizes of engine and model."""
    digest = hashlib.sha256()
    root = Path(__file__).parent
    for path in sorted(path for path in root.rglob("*") if path.suffix in _SOURCES):
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
