"""The packages that engines compute with, as a table that can be read without importing them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from throwcollect.extras import require


@dataclass(frozen=True)
class EnginePackage:
    """The package of an engine.

    Attributes:
        distribution: Its name on the package index.
        module: Its name in imports.
        compiled: Pattern of the compiled file beside its module.
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
"""The package of each engine of our own that has one, by name of the engine."""


def require_engine(name: str) -> None:
    """Check that the package of an engine is installed, before anything begins.

    Raises:
        MissingExtraError: If its package is not installed.
    """
    if name in PACKAGES:
        require(PACKAGES[name].module)
