"""Single values of a configuration by their dotted keys: read, replace, and which of them a sweep may vary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from throwcollect.config.problems import Location, dotted, findings, unknown_key
from throwcollect.config.schema import Config
from throwcollect.config.section import Section
from throwcollect.errors import ConfigError, Problem

_SWEEPABLE = (
    "task.start.",
    "task.end.",
    "task.duration_s",
    "task.trajectory.",
    "ball.",
    "scene.",
    "robot.position_gain_per_s",
    "robot.velocity_gain",
    "robot.effort_scale",
    "sim.command_delay_s",
    "sim.settle_s",
)
_FIXED = ("task.trajectory.basis_functions",)

AnySection = TypeVar("AnySection", bound=Section)


def with_values(config: Config, values: Mapping[str, float]) -> Config:
    """The configuration with some of its values replaced, such as that of one trial.

    Args:
        config: Configuration to start from; it stays as it is.
        values: New values by dotted key; items of lists go by their index from 0. Keys must be present in `config`.

    Raises:
        ConfigError: If a key does not exist, or the result would not be valid.
    """
    changes: dict[str, Any] = {}
    for key, value in values.items():
        *above, last = key.split(".")
        holder = changes
        for part in above:
            holder = holder.setdefault(part, {})
        holder[last] = value
    return _changed(config, changes, ())


def leaves(config: Config) -> Iterator[tuple[str, Any]]:
    """Dotted key and value of everything in a configuration that holds nothing further.

    Empty dictionaries and lists count as values.
    """
    return _leaves(config, ())


def differences(one: Config, other: Config) -> dict[str, tuple[Any, Any]]:
    """Dotted keys in which two configurations differ, with both values; None where a key is absent."""
    before, after = dict(leaves(one)), dict(leaves(other))
    keys = [*before, *(key for key in after if key not in before)]
    return {key: (before.get(key), after.get(key)) for key in keys if before.get(key) != after.get(key)}


def sweepable_keys(config: Config) -> list[str]:
    """Dotted keys that a sweep of this configuration may vary."""
    return [key for key, value in leaves(config) if _obstacle(config, key, value) is None]


def reason_not_sweepable(config: Config, key: str) -> str | None:
    """Why a sweep may not vary a key, or None when it may.

    Numbers of the task's motion, of the ball, the scene, the motors and their delay may vary from trial to trial; what
    the simulated world is built from, what is recorded and how may not.

    Args:
        config: Configuration that is swept.
        key: Dotted key.
    """
    values = dict(leaves(config))
    if key not in values:
        return unknown_key(key, sweepable_keys(config))
    return _obstacle(config, key, values[key])


def _obstacle(config: Config, key: str, value: Any) -> str | None:
    if not key.startswith(_SWEEPABLE) or key in _FIXED:
        return "cannot vary from trial to trial"
    if not isinstance(value, (int, float)):
        return "cannot be swept, as it is not a number"
    joint = key.removeprefix("task.start.")
    if joint != key and joint not in config.task.end:
        return f"cannot vary from trial to trial, as task.end does not name {joint}"
    return None


def _leaves(value: Any, location: Location) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Section):
        items: Any = value.__dict__.items()
    elif isinstance(value, dict):
        items = value.items()
    else:
        items = enumerate(value) if isinstance(value, list) else ()
    found = False
    for part, inner in items:
        found = True
        yield from _leaves(inner, (*location, part))
    if not found:
        yield dotted(location), value


def _changed(section: AnySection, changes: Mapping[str, Any], location: Location) -> AnySection:
    values = dict(section.__dict__)
    for part, change in changes.items():
        if part not in values:
            raise _unknown((*location, part), list(values))
        values[part] = _replaced(values[part], change, (*location, part))
    try:
        # Strictly, so that a number in quotes is no number; sections that have not changed are not looked at again.
        return type(section).model_validate(values, strict=True)
    except ValidationError as error:
        found = findings(error, values, above=location)
        raise ConfigError([Problem(each.sentence, each.key) for each in found]) from error


def _replaced(value: Any, change: Any, location: Location) -> Any:
    if not isinstance(change, dict):
        return change
    if isinstance(value, Section):
        return _changed(value, change, location)
    copy: Any = dict(enumerate(value)) if isinstance(value, list) else dict(value) if isinstance(value, dict) else {}
    for part, inner in change.items():
        index = int(part) if isinstance(value, list) and part.isdecimal() else part
        if index not in copy:
            raise _unknown((*location, part), list(map(str, copy)))
        copy[index] = _replaced(copy[index], inner, (*location, index))
    return list(copy.values()) if isinstance(value, list) else copy


def _unknown(location: Location, known: list[str]) -> ConfigError:
    return ConfigError([Problem(unknown_key(str(location[-1]), known), dotted(location))])


def is_physics(key: str) -> bool:
    """Whether a sweepable key concerns the simulation, and not only the trajectory that it is sent."""
    return not key.startswith("task.") or key.startswith("task.start.")
