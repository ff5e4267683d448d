"""Loads the sections of tools and tasks; those of other packages are checked, as they read every configuration."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from throwcollect.config.section import Section
from throwcollect.config.target_columns import TARGET_PREFIX, TargetColumn
from throwcollect.config.task_config import TaskConfig
from throwcollect.config.until import UntilConfig
from throwcollect.errors import ConfigError
from throwcollect.members import describe_member, is_own, load_member


def load_section(family: str, name: str) -> Any:
    """Import the section of a member of ``tools`` or ``tasks``.

    Raises:
        ConfigError: If the member comes from another package, and cannot be imported or declares something wrong.
    """
    section = load_member(family, name)
    if not is_own(family, name) and (wrong := next(_find_mistakes(section, name), None)) is not None:
        raise ConfigError(f"{describe_member(family, name)}: {section.__module__}.{section.__qualname__}: {wrong}")
    return section


def _find_mistakes(section: type[Section], name: str) -> Iterator[str]:
    """Say what is wrong with the section of a member of this name, one sentence each."""
    named = section.model_fields["name"]
    if get_args(named.annotation) != (name,) or named.default != name:
        # Otherwise a configuration could name the member in another way, or in none.
        yield f"the key name should be declared as `name: Literal[{name!r}] = {name!r}`, like the entry point"
    implementation: object = getattr(section, "implementation", None)
    if not isinstance(implementation, str) or ":" not in implementation:
        yield f"implementation should be a text 'module:class', is {implementation!r}"
    if issubclass(section, TaskConfig):
        yield from _find_mistakes_of_task(section)


def _find_mistakes_of_task(section: type[TaskConfig]) -> Iterator[str]:
    until: object = section.until
    if not (isinstance(until, type) and issubclass(until, UntilConfig)):
        yield f"until should be a class derived from {UntilConfig.__module__}.{UntilConfig.__name__}, is {until!r}"
    elif len(until.model_fields) != 1:
        keys = ", ".join(until.model_fields) or "none"
        yield f"until should have one key, the outcome of a trial that succeeded; {until.__qualname__} has {keys}"
    for attribute, kind in (("targets", str), ("given", str), ("target_columns", TargetColumn)):
        values = getattr(section, attribute)
        if not isinstance(values, tuple) or not all(isinstance(each, kind) for each in values):
            yield f"{attribute} should be a tuple of {kind.__name__}, is {values!r}"
            return
    for each in section.target_columns:
        if not each.name.startswith(TARGET_PREFIX):
            yield f"the name of a column of targets should begin with {TARGET_PREFIX}, is {each.name}"
