"""Reads a YAML file and overrides into a configuration that is complete and valid, and writes it as text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from throwcollect.arguments import read_list, read_path
from throwcollect.config.document import Document, Plain
from throwcollect.config.problems import (
    MOST_EXAMINED,
    PARAMETERS,
    SWEPT_FIELDS,
    KeyProblem,
    Location,
    findings,
    join_key,
)
from throwcollect.config.schema import Config, Range
from throwcollect.config.shape import shape_of
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError
from throwcollect.files import StrPath
from throwcollect.members import names_of, usable_names
from throwcollect.wording import find_near

_SIMULATIONS = ("run", "simulations")
_SHALLOWEST_MAPPING = 2
"""Least number of parts in the key of a mapping: keys of the first level are sections or single values."""
_PLAIN_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
# Without quotes, these words are no text: the first three in YAML 1.2, the others for readers of YAML 1.1.
_NOT_PLAIN = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


def load(path: StrPath, overrides: Sequence[str] = ()) -> Config:
    """Read a configuration file.

    Args:
        path: YAML 1.2 file.
        overrides: ``key=value`` pairs that win over the file, later ones over earlier ones: dotted keys, and values
            that are read as YAML.

    Returns:
        The resolved configuration: every key has its value, also where the file leaves it out.

    Raises:
        ConfigError: If the file cannot be read or anything in it is wrong; it holds all problems, unknown keys first.
            Also if the overrides are no list of texts.
    """
    with load_locating_errors(read_path("path", path), overrides) as config:
        return config


@contextmanager
def load_locating_errors(path: Path, overrides: Sequence[str] = ()) -> Iterator[Config]:
    """Read a configuration file as `load` does, and add lines of the file to a `ConfigError` that the block raises.

    Raises:
        ConfigError: If the file cannot be read or anything in it is wrong, or the block raises one.
    """
    settings = read_list("overrides", overrides, "texts KEY=VALUE")
    document = Document(path)
    for override in settings:
        document.override(override, find_default=partial(_find_default, document.values))
    config, found, more = _check(document.values)
    if config is not None and document.is_overridden(_SIMULATIONS):
        found += _find_simulations_problem(config)
    found = [each for each in found if each.location not in document.left_out]
    problems = [document.problem(each.location, each.sentence) for each in found]
    unknown = sum(each.unknown for each in found)
    rest = sorted([*document.problems, *problems[unknown:]], key=lambda problem: problem.line or 0)
    if rest or unknown or config is None:
        raise ConfigError([*problems[:unknown], *rest], more=more)
    try:
        yield config
    except ConfigError as error:
        problems = [document.place(problem) for problem in error.problems]
        raise type(error)(problems, expected=error.expected, hint=error.hint) from error


def dump_yaml(config: Config) -> str:
    """Write a configuration with all its keys as YAML that loads back to an equal one.

    The text is part of every dataset, so it must not depend on the version of a library that writes YAML.
    """
    return "".join(f"{line}\n" for line in _write_lines(config.model_dump(), ""))


def value_as_yaml(value: Any) -> str:
    """Write a value of a configuration as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{value_as_yaml(key)}: {value_as_yaml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(value_as_yaml, value))}]"
    if isinstance(value, str) and _PLAIN_WORD.fullmatch(value) and value.lower() not in _NOT_PLAIN:
        return value
    if isinstance(value, str):
        return '"' + "".join(_escape_character(character) for character in value) + '"'
    return json.dumps(value)


def _escape_character(character: str) -> str:
    plain = character.isprintable() and character not in '"\\'
    return character if plain else f"\\U{ord(character):08x}"


def _find_default(values: dict[str, Any], location: Location) -> Mapping[str, Plain]:
    """Find the default of a mapping that is no section, such as ``task.end``; empty if there is no such mapping."""
    if len(location) < _SHALLOWEST_MAPPING:
        return {}
    # Other keys may still be wrong; `_check` puts defaults in their places, and gives None if that does not help.
    holder: Any = _check(values)[0]
    for part in location:
        holder = getattr(holder, str(part), None)
    return holder if isinstance(holder, dict) else {}


def _check(values: dict[str, Any]) -> tuple[Config | None, list[KeyProblem], int]:
    """Validate values; after a problem, put defaults in place of what was wrong, and validate again to find the rest.

    Returns:
        The configuration, or None; the findings; and the number of further problems, which are only counted.
    """
    # Wrong values are removed from this copy below; the caller still needs the values as the user wrote them.
    values = deepcopy(values)
    robot = _find_robot(values)
    misnamed = _find_misnamed(values)
    sweep = values.get(PARAMETERS[0])
    found = list(_find_nested(sweep.get(PARAMETERS[1]) if isinstance(sweep, dict) else None))
    replaced = {finding.location[:3] for finding in found}
    for place in replaced:
        _remove(values, place)
    config = None
    more = 0
    while config is None and len(found) < MOST_EXAMINED:
        try:
            config = Config.model_validate(values, strict=True, context=robot)
            fresh = list(_find_sweep_problems(config))
        except ValidationError as error:
            fresh = findings(error, values)
            more += max(0, error.error_count() - MOST_EXAMINED)
        found += [finding for finding in fresh if not any(_is_about(finding, location) for location in replaced)]
        # Remove only the key of the section (two parts) or the swept key (three parts), so that the others stay.
        places = {finding.location[: 3 if finding.location[:2] == PARAMETERS else 2] for finding in fresh}
        removed = {place for place in places if _remove(values, place)}
        # A misspelt key now has its default under the right name, or is missing there.
        replaced |= places | {(*finding.location[:-1], finding.meant) for finding in fresh if finding.meant}
        # Without a known robot, each joint would be reported; without a known task or tool, each of its keys.
        if not removed or robot is None or misnamed:
            break
    found = [each for each in found if each.location[0] not in misnamed or each.location[1:] == ("name",)]
    return config, sorted(found, key=lambda finding: not finding.unknown), more


def _find_robot(values: dict[str, Any]) -> str | None:
    """Find the name of the robot whose joints the values may name; None if there is no such robot."""
    name = _read_name(values, "robot")
    return Config().robot.name if name is None else name if name in names_of("robots") else None


def _find_misnamed(values: dict[str, Any]) -> set[str]:
    """Find the sections whose keys cannot be known, as no working package has the task or tool that they name."""
    misnamed = set()
    for section in ("task", "tool"):
        name, known = _read_name(values, section), usable_names(f"{section}s")
        if isinstance(name, str) and name not in known:
            misnamed.add(section)
            # The section `until` is the task's, too. If the name is only misspelt, both may be wrong.
            if section == "task" and not find_near(name, known):
                misnamed.add("until")
    return misnamed


def _read_name(values: dict[str, Any], section: str) -> Any:
    holder = values.get(section)
    return holder.get("name") if isinstance(holder, dict) else None


def _is_about(finding: KeyProblem, location: Location) -> bool:
    """Whether a finding may be about the default that was put at a location, and not about a value of the user."""
    if finding.location[: len(location)] == location:
        return True
    if finding.unknown:
        return str(finding.location[-1]).startswith(f"{join_key(location)}.")
    return location[-1] in re.findall(r"\w+", finding.sentence)


def _remove(values: dict[str, Any], location: Location) -> bool:
    """Remove the value at a location, or the section if it lacks that value; return whether anything was removed."""
    holder: Any = values
    for part in location[:-1]:
        holder = holder.get(part) if isinstance(holder, dict) else None
    if isinstance(holder, dict) and location[-1] in holder:
        del holder[location[-1]]
        return True
    return values.pop(str(location[0]), None) is not None


def _find_nested(swept: Any, location: Location = PARAMETERS) -> Iterator[KeyProblem]:
    """Find swept keys that are written as sections in sections, in the section `swept` at a location."""
    for name, value in swept.items() if isinstance(swept, dict) else ():
        place = (*location, name)
        key = join_key(place[len(PARAMETERS) :])
        if isinstance(value, dict) and SWEPT_FIELDS.isdisjoint(value) and shape_of(key.split(".")).has_keys:
            yield from _find_nested(value, place)
        elif len(place) > len(PARAMETERS) + 1:
            yield KeyProblem(place, f"write {key} as one key")


def _find_sweep_problems(config: Config) -> Iterator[KeyProblem]:
    sampler = config.sweep.sampler
    if config.sweep.parameters and sampler != "grid" and config.trials is None and config.until is None:
        wanted = f"or (until) how many should have {config.task.success}"
        sentence = f"missing; the sampler {sampler} should know how many trials to draw, {wanted}"
        yield KeyProblem(("trials",), sentence)
    for key, parameter in config.sweep.parameters.items():
        location: Location = (*PARAMETERS, key)
        if reason := reason_not_sweepable(config, key):
            yield KeyProblem(location, reason, unknown=reason.startswith("unknown key"))
            continue
        if isinstance(parameter, Range):
            values: dict[Location, float] = {("min",): parameter.min, ("max",): parameter.max}
        else:
            values = {("values", index): value for index, value in enumerate(parameter.values)}
        for part, value in values.items():
            try:
                with_values(config, {key: value})
            except ConfigError as error:
                yield KeyProblem((*location, *part), error.problems[0].message)


def _find_simulations_problem(config: Config) -> Iterator[KeyProblem]:
    """Report a number of simulations that was given by an override, and that the runtime cannot have.

    A number in a file is not reported, as the file may be used with any runtime, and the file of every dataset has one.
    """
    run = config.run
    # A wrong value was replaced by the default, which nobody has asked for.
    if run.runtime == "inprocess" and run.simulations > 1 and "simulations" in run.model_fields_set:
        yield KeyProblem(_SIMULATIONS, f"should be 1 with the runtime inprocess, got {run.simulations}")


def _write_lines(values: dict[str, Any], indent: str) -> Iterator[str]:
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield f"{indent}{value_as_yaml(key)}:"
            yield from _write_lines(value, indent + "  ")
        else:
            yield f"{indent}{value_as_yaml(key)}: {value_as_yaml(value)}"
