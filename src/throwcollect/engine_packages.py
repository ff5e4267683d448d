"""The packages that engines compute with, known without importing them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from throwcollect.extras import require


@dataclass(frozen=True)
class EnginePackage:
    """The package of an engine.

    Attributes:
        distribution: Its name on the package index, which has its version.
        module: Its name when it is imported.
        compiled: Which file beside its module holds what is compiled.
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
"""The package of each engine that has one; of engines of other packages, the version of that package counts."""


def require_engine(name: str) -> None:
    """Find out whether an engine can compute on this Python, before anything is begun.

    Args:
        name: Its name, as in ``sim.engine``.

    Raises:
        MissingExtraError: If its package is not installed.
    """
    if name in PACKAGES:
        require(PACKAGES[name].module)
