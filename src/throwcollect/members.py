"""Families of parts of a collection, such as robots and tools, and their members by name.

A family has members of our own, and those that other installed packages add by an entry point of the group
``throwcollect.<family>``. The name of the entry point is that of the member, and its object is of the same kind as the
objects in the table here::

    [project.entry-points."throwcollect.robots"]
    planar_arm = "my_package.robot:PLANAR_ARM"

The table holds names of objects and not the objects, so that a configuration can be read without importing the
libraries of simulations.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

_OWN = MappingProxyType(
    {
        "robots": {"talos": "throwcollect.robots.talos:TALOS"},
        "tools": {"spoon": "throwcollect.tools.spoon.config:SpoonConfig"},
        "engines": {
            "bullet": "throwcollect.engines.bullet.bullet_engine:BulletEngine",
            "mujoco": "throwcollect.engines.mujoco.mujoco_engine:MujocoEngine",
            "ballistic": "throwcollect.engines.ballistic.ballistic_engine:BallisticEngine",
        },
        "tasks": {"throw": "throwcollect.tasks.throw.config:ThrowConfig"},
        "runtimes": {
            "local": "throwcollect.runtimes.local:LocalRuntime",
            "docker": "throwcollect.runtimes.docker.runtime:DockerRuntime",
            "inprocess": "throwcollect.runtimes.in_process:InProcessRuntime",
        },
    }
)


def names_of(family: str) -> tuple[str, ...]:
    """List the names of the members of a family: our own first, then those of other packages, by name."""
    return tuple(_table(family))


@cache
def load_member(family: str, name: str) -> Any:
    """Import a member of a family; the cache is for callers that ask with every trial.

    Args:
        family: ``robots``, ``tools``, ``engines``, ``tasks`` or ``runtimes``.
        name: Name of the member.

    Returns:
        A `Robot`; the class of an engine or a runtime; for a tool or a task, the class of its section.

    Raises:
        KeyError: If the family has no such member.
        ImportError: If the package that the member is in cannot be imported.
    """
    return _table(family)[name].load()


def load_object(path: str) -> Any:
    """Import the object ``module:name``."""
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)


@cache
def _table(family: str) -> Mapping[str, EntryPoint]:
    group = f"throwcollect.{family}"
    own = {name: EntryPoint(name, path, group) for name, path in _OWN[family].items()}
    others = {entry.name: entry for entry in sorted(entry_points(group=group), key=lambda entry: entry.name)}
    return MappingProxyType(own | {name: entry for name, entry in others.items() if name not in own})
