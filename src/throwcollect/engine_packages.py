"""The packages that engines compute with, as a table that can be read without importing them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from throwcollect.extras import require


@dataclass(frozen=True)
class EnginePackage:
    """The package of an engine.

    Attributes:
        distribution: Name of the package on the package index.
        module: Name of the package in imports.
        compiled: Pattern of the name of the compiled file, which lies beside the module.
    """

    distribution: str
    module: str
    compiled: str


PACKAGES = MappingProxyType(
    {
        "bullet": EnginePackage("pybullet", "pybullet", "pybullet.*.so"),
        "mujoco": EnginePackage("mujoco-core", "mujoco", "libmujoco.so.*"),
    }
)
"""The package of each engine of our own that needs one, by name of the engine."""


def require_engine(name: str) -> None:
    """Check that the package of an engine is installed, before anything begins."""
    if name in PACKAGES:
        require(PACKAGES[name].module)
