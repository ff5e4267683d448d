"""Single values of a configuration, by their dotted keys: reads, replaces and compares them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import ValidationError

from throwcollect.config.key import Effect, Key, key_of_field, overlay
from throwcollect.config.problems import Location, find_problems, join_key, read_index, unknown_key
from throwcollect.config.schema import Config
from throwcollect.config.section import Section
from throwcollect.config.sensors import SensorSections
from throwcollect.errors import ConfigError, Problem

AnySection = TypeVar("AnySection", bound=Section)
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_]")


@cache
def column_of(key: str) -> str:
    """Name the column of a swept key in tables of throws: the key with underscores, such as ``task_duration_s``.

    Such a name needs no quotes in SQL and formulas. The name of any other column is returned as it is.
    """
    return _NOT_IN_NAMES.sub("_", key)


def keys_by_column(config: Config, columns: Iterable[str]) -> dict[str, str]:
    """Map those of some columns that belong to swept keys to these keys, in the order of the columns."""
    keys = {column_of(key): key for key in sweepable_keys(config)}
    return {column: keys[column] for column in columns if column in keys}


def with_values(config: Config, values: Mapping[str, float | str | Section | Sequence[str]]) -> Config:
    """Make a configuration with some of its values replaced, such as the configuration of one trial.

    Args:
        config: The configuration, which stays as it is.
        values: New values by dotted key, which `config` must have; an item of a list is named by its index, from 0.
    """
    changes: dict[str, Any] = {}
    for key, value in values.items():
        *above, last = key.split(".")
        holder = changes
        for part in above:
            holder = holder.setdefault(part, {})
        holder[last] = value
    return _change(config, changes, ())


@dataclass(frozen=True)
class Leaf:
    """A value of a configuration that holds no other value; an empty dictionary or list is a leaf, too.

    Attributes:
        name: Dotted key.
        value: The value.
        key: Annotation that holds for the key.
    """

    name: str
    value: Any
    key: Key


def leaves(config: Config) -> Iterator[Leaf]:
    """List the leaves of a configuration, in the order in which their keys are declared."""
    return _list_leaves(config, (), Key())


def values_by_key(config: Config) -> dict[str, Any]:
    """Map the dotted key of each leaf of a configuration to its value."""
    return {leaf.name: leaf.value for leaf in leaves(config)}


def differences(one: Config, other: Config) -> dict[str, tuple[Any, Any]]:
    """Find the dotted keys in which two configurations differ, with both values; None where a key is absent."""
    before, after = values_by_key(one), values_by_key(other)
    return {key: (before.get(key), after.get(key)) for key in before | after if before.get(key) != after.get(key)}


def sweepable_keys(config: Config, effect: Effect | None = None) -> list[str]:
    """List the dotted keys that a sweep of this configuration may vary; with `effect`, only those with this effect."""
    return [
        leaf.name
        for leaf in leaves(config)
        if effect in (None, leaf.key.effect) and _find_obstacle(config, leaf) is None
    ]


@cache
def list_operator_keys() -> tuple[str, ...]:
    """List the dotted keys that only the operator of a server sets, without those that lie below another of them.

    A `*` in the place of a name stands for any.
    """
    return tuple(_find_operator_keys(Config))


def with_sensors(config: Config, sensors: SensorSections) -> Config:
    """Make a copy of a configuration with other sensors: sections by name, as they are in YAML."""
    return _validate(type(config), {**config.__dict__, "sensors": dict(sensors)}, (), strict=False)


def reason_not_sweepable(config: Config, key: str) -> str | None:
    """Explain why a sweep may not vary a key; None when it may.

    Numbers of the task's motion, of the ball, the scene and the motors may vary from trial to trial. The world is built
    and the recording is set up only once, so their other keys may not.
    """
    found = {leaf.name: leaf for leaf in leaves(config)}
    return _find_obstacle(config, found[key]) if key in found else unknown_key(key, sweepable_keys(config))


def _find_obstacle(config: Config, leaf: Leaf) -> str | None:
    if not leaf.key.swept:
        return "cannot vary from trial to trial"
    if isinstance(leaf.value, int) and not isinstance(leaf.value, bool):
        return "cannot be swept, as it is an integer; the values of a sweep have decimals"
    # The number of a motion in a file may be null. In the world, null means that something is not there.
    is_chosen_later = leaf.value is None and leaf.key.effect is Effect.TASK
    if not (isinstance(leaf.value, float) or is_chosen_later):
        return "cannot be swept, as it is not a number"
    joint = leaf.name.removeprefix("task.start.")
    if joint != leaf.name and joint not in config.task.end:
        return f"cannot vary from trial to trial, as task.end does not name {joint}"
    return None


def _find_operator_keys(kind: Any) -> Iterator[str]:
    """List the keys of a section, or of all sections that a type allows; a name in a mapping is ``*``."""
    if isinstance(kind, type) and issubclass(kind, Section):
        for name, field in kind.model_fields.items():
            below = dict.fromkeys(_find_operator_keys(field.annotation))
            yield from [name] if key_of_field(kind, name).operator else (f"{name}.{key}" for key in below)
    elif get_origin(kind) is dict:
        yield from (f"*.{key}" for key in _find_operator_keys(get_args(kind)[1]))
    elif get_origin(kind) in (Annotated, Union, UnionType):
        for each in get_args(kind):
            yield from _find_operator_keys(each)


def _list_leaves(value: Any, location: Location, key: Key) -> Iterator[Leaf]:
    if isinstance(value, Section):
        for name, inner in value.__dict__.items():
            yield from _list_leaves(inner, (*location, name), overlay(key, type(value), name))
    elif isinstance(value, dict | list) and value:
        for part, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _list_leaves(inner, (*location, part), key)
    else:
        yield Leaf(join_key(location), value, key)


def _change(section: AnySection, changes: Mapping[str, Any], location: Location) -> AnySection:
    values = dict(section.__dict__)
    for part, change in changes.items():
        if part not in values:
            raise _make_unknown_key_error((*location, part), list(values))
        values[part] = _replace(values[part], change, (*location, part))
    # Strictly, so that a string in quotes is not taken for a number.
    return _validate(type(section), values, location, strict=True)


def _validate(section: type[AnySection], values: Mapping[str, Any], location: Location, *, strict: bool) -> AnySection:
    """Make a section of its values; Pydantic does not validate sections among them again."""
    try:
        return section.model_validate(values, strict=strict)
    except ValidationError as error:
        found = find_problems(error, section, values)
        problems = [Problem(sentence, join_key((*location, *place))) for place, sentence in found.items()]
        raise ConfigError(problems) from error


def _replace(value: Any, change: Any, location: Location) -> Any:
    if not isinstance(change, dict):
        return change
    if isinstance(value, Section):
        return _change(value, change, location)
    # A list is changed as a mapping from index to item; of any other value, each part is an unknown key.
    copy: Any = dict(enumerate(value)) if isinstance(value, list) else dict(value) if isinstance(value, dict) else {}
    for part, inner in change.items():
        index = read_index(value, part)
        if index not in copy:
            raise _make_unknown_key_error((*location, part), list(map(str, copy)))
        copy[index] = _replace(copy[index], inner, (*location, index))
    return list(copy.values()) if isinstance(value, list) else copy


def _make_unknown_key_error(location: Location, known: list[str]) -> ConfigError:
    return ConfigError([Problem(unknown_key(str(location[-1]), known), join_key(location))])
