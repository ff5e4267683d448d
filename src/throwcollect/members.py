"""Families of parts, such as robots, tools and formats of exports, and their members by name.

A family has members of our own, and members that other installed packages add by an entry point of the group
``throwcollect.<family>``. The entry point has the name of the member, and its object is of the same kind as the objects
in the table here::

    [project.entry-points."throwcollect.robots"]
    planar_arm = "my_package.robot:PLANAR_ARM"

The table holds names of objects and not the objects, so that a configuration can be read without importing the
libraries of simulations.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any

from throwcollect.errors import ConfigError, MemberError, ThrowcollectError
from throwcollect.extras import explain_missing

_OWN = MappingProxyType(
    {
        "robots": {
            "talos": "throwcollect.robots.talos:TALOS",
            "talos_left": "throwcollect.robots.talos:TALOS_LEFT",
            "panda": "throwcollect.robots.example_robots:PANDA",
            "ur5": "throwcollect.robots.example_robots:UR5",
            "xarm7": "throwcollect.robots.example_robots:XARM7",
            "so101": "throwcollect.robots.example_robots:SO101",
            "tiago": "throwcollect.robots.example_robots:TIAGO",
        },
        "tools": {
            "spoon": "throwcollect.robots.tools.spoon.spoon_config:SpoonConfig",
            "claw": "throwcollect.robots.tools.claw.claw_config:ClawConfig",
            "paddle": "throwcollect.robots.tools.paddle.paddle_config:PaddleConfig",
        },
        "engines": {
            "bullet": "throwcollect.engines.bullet.bullet_engine:BulletEngine",
            "mujoco": "throwcollect.engines.mujoco.mujoco_engine:MujocoEngine",
            "ballistic": "throwcollect.engines.ballistic.ballistic_engine:BallisticEngine",
        },
        "tasks": {
            "throw": "throwcollect.tasks.throw.throw_config:ThrowConfig",
            "throw_into": "throwcollect.tasks.throw_into.into_config:ThrowIntoConfig",
            "slide": "throwcollect.tasks.slide.slide_config:SlideConfig",
        },
        "runtimes": {
            "local": "throwcollect.collect.runtimes.local:LocalRuntime",
            "docker": "throwcollect.collect.runtimes.docker.docker_runtime:DockerRuntime",
            "inprocess": "throwcollect.collect.runtimes.in_process:InProcessRuntime",
        },
        "exporters": {
            "parquet": "throwcollect.publish.export.parquet:PARQUET",
            "npz": "throwcollect.publish.export.npz:NPZ",
            "lerobot": "throwcollect.publish.export.lerobot:LEROBOT",
            "hdf5": "throwcollect.publish.export.hdf5:HDF5",
            "mat": "throwcollect.publish.export.mat:MAT",
        },
        "policies": {},
    }
)

_KINDS = MappingProxyType(
    {
        "robots": "throwcollect.robots.robot:Robot",
        "tools": "throwcollect.config.tool_config:ToolConfig",
        "engines": "throwcollect.engines.engine:Engine",
        "tasks": "throwcollect.config.task_config:TaskConfig",
        "runtimes": "throwcollect.collect.runtimes.runtime:Runtime",
        "exporters": "throwcollect.publish.export.exporter:Exporter",
        "policies": "collections.abc:Callable",
    }
)
"""The class of each family: its members are values of this class (see `_VALUES`), or else classes derived from it."""

_VALUES = frozenset({"robots", "exporters", "policies"})
"""The families whose members are values; members of all other families are classes."""

_DEBUG = "THROWCOLLECT_DEBUG"
_WAY_OUT = f"mend or uninstall the package that it belongs to; {_DEBUG}=1 shows where it fails"
"""The hint if code of another package fails."""


def names_of(family: str) -> tuple[str, ...]:
    """List the names of the members of a family: our own first, then those of other packages, by name."""
    return tuple(_find_members()[family])


@cache
def load_member(family: str, name: str) -> Any:
    """Import a member of a family by its name.

    The result is cached for callers that ask for it in every trial.

    Returns:
        A `Robot`, an `Exporter`, or a function that makes a policy; the class of an engine or a runtime; for a tool or
        a task, the class of its section.
    """
    entry = _find_members()[family][name]
    if is_own(family, name):
        return entry.load()
    what, namesakes = _describe(family, name), _find_namesakes(family, name)
    if len({each.value for each in namesakes}) > 1:
        raise ConfigError(f"{what}: only one package may use a name", hint="uninstall all of these packages but one")
    found, kind = load_part(family, name, entry.value), import_own(_KINDS[family])
    if not (isinstance(found, kind) if family in _VALUES else isinstance(found, type) and issubclass(found, kind)):
        raise ConfigError(f"{what}: {entry.value} should be of {kind.__module__}.{kind.__name__}, is {found!r}")
    # A section of a configuration has its name as the default of a key; engines, runtimes and exporters have none.
    key = getattr(found, "model_fields", {}).get("name")
    if (given := getattr(found, "name", name) if key is None else key.default) != name:
        sentence = f"{what}: {entry.value} should have the name of its entry point, {name!r}, has {given!r}"
        raise ConfigError(sentence)
    return found


@cache
def find_broken(family: str) -> Mapping[str, ThrowcollectError]:
    """Find the members of a family that cannot be loaded, each with its error.

    They come from other packages, and concern only configurations that name them.
    """
    errors: dict[str, ThrowcollectError] = {}
    for name in names_of(family):
        try:
            if not is_own(family, name):
                load_member(family, name)
        except ThrowcollectError as error:
            errors[name] = error
    return MappingProxyType(errors)


def usable_names(family: str) -> tuple[str, ...]:
    """List the names of the members of a family that can be loaded, in the order of `names_of`."""
    broken = find_broken(family)
    return tuple(name for name in names_of(family) if name not in broken)


def is_own(family: str, name: str) -> bool:
    """Whether a member comes with throwcollect, and not from another package."""
    return name in _OWN[family]


def find_modules(family: str, name: str) -> list[str]:
    """Find the module of a member of our own; none if another package brings it, as that may fail in any way."""
    return [_OWN[family][name].partition(":")[0]] if is_own(family, name) else []


def list_origins(family: str, name: str) -> list[str]:
    """List the packages that bring a member, with their versions and what they bring; none if it is our own."""
    if is_own(family, name):
        return []
    namesakes = _find_namesakes(family, name)
    return sorted(f"{each.group} {name}: {each.value} of {_name_owner(each)}" for each in namesakes)


def load_part(family: str, name: str, path: str) -> Any:
    """Import the object ``module:name`` that a member names."""
    if is_own(family, name):
        return import_own(path)
    try:
        with explain_missing():
            # Unlike `getattr`, an entry point also finds an attribute of an attribute.
            return EntryPoint("", path, "").load()
    except ThrowcollectError:
        raise
    # `SystemExit` would end the process without a word.
    except (Exception, SystemExit) as error:
        sentence = f"{_describe(family, name)} cannot be loaded: {type(error).__name__}: {error}"
        raise ConfigError(sentence, hint=_WAY_OUT) from error


@contextmanager
def explain_failure(family: str, name: str, doing: str, *, passing: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Report an error that a member of another package raises in the block as a fault of that package.

    Errors of our own members are let through, because they are faults of throwcollect. Errors of the types `passing`
    are let through, too, because the caller explains them.

    Args:
        family: Family of the member.
        name: Name of the member.
        doing: What the member was asked to do, such as ``judge trial 3``.
        passing: Types of errors to let through.
    """
    if is_own(family, name):
        yield
        return
    try:
        with explain_missing():
            yield
    except ThrowcollectError:
        raise
    # `SystemExit` would end the process without a word, or as often as a simulation is started again.
    except (Exception, SystemExit) as error:
        if isinstance(error, passing):
            raise
        if os.environ.get(_DEBUG):
            # In a simulation, only the message of the error gets on, as the reason for which a trial is refused.
            traceback.print_exc()
        what = _describe(family, name)
        raise MemberError(f"{what} cannot {doing}: {type(error).__name__}: {error}", hint=_WAY_OUT) from error


@cache
def import_own(path: str) -> Any:
    """Import an object ``module:name`` of our own once, because parts are asked for several times in every trial."""
    return EntryPoint("", path, "").load()


def _describe(family: str, name: str) -> str:
    """Name a member of another package and that package, as the beginning of a message."""
    owners = sorted(map(_name_owner, _find_namesakes(family, name)))
    kind = "policy" if family == "policies" else family.removesuffix("s")
    # A policy may be an object, or a function that no package has given a name.
    return f"the {kind} {name}" + (f" of {' and '.join(owners)}" if owners else "")


def _find_namesakes(family: str, name: str) -> list[EntryPoint]:
    """Find all members of other packages that have a name."""
    return [each for each in entry_points(group=f"throwcollect.{family}") if each.name == name]


def _name_owner(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown package"


@cache
def _find_members() -> Mapping[str, Mapping[str, EntryPoint]]:
    """Find all members, by family and name; our own first, then those of other packages, by name.

    All families are looked up together, because Python reads the files of all installed packages each time that it
    looks for entry points, which takes 10 ms.
    """
    installed, found = entry_points(), {}
    for family, own in _OWN.items():
        group = f"throwcollect.{family}"
        others = {each.name: each for each in sorted(installed.select(group=group), key=lambda each: each.name)}
        ours = {name: EntryPoint(name, path, group) for name, path in own.items()}
        # No package may replace a member of our own, or a configuration would mean something else where the package is.
        found[family] = ours | {name: each for name, each in others.items() if name not in ours}
    return MappingProxyType(found)
