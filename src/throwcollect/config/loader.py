"""Reads a YAML file and overrides into a configuration that is complete and valid, and writes it as text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from throwcollect.config.document import Document, Plain
from throwcollect.config.motion import MotionFile
from throwcollect.config.problems import PARAMETERS, Location
from throwcollect.config.robot_config import AnyRobot, DescribedRobotConfig, RobotConfig
from throwcollect.config.scene import AnyBody, FileBodyConfig
from throwcollect.config.schema import Config, Range
from throwcollect.config.section import Section
from throwcollect.config.sensors import AnySensor, Sensors
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError
from throwcollect.files import StrPath
from throwcollect.members import import_own

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
        ConfigError: If the file cannot be read or anything in it is wrong. It holds all wrong keys and values at once;
            what only contradicts something else is found once these are right.
    """
    with load_locating_errors(Path(path), overrides) as config:
        return config


@contextmanager
def load_locating_errors(path: Path, overrides: Sequence[str] = ()) -> Iterator[Config]:
    """Read a configuration file as `load` does, and add lines of the file to a `ConfigError` that the block raises.

    Raises:
        ConfigError: If the file cannot be read or anything in it is wrong, or the block raises one.
    """
    document = Document(path)
    for override in overrides:
        document.override(override, find_default=partial(_find_default, document.values))
    robot = _find_robot(document, path.parent)
    _find_motions(document, path.parent, robot)
    _find_bodies(document, path.parent)
    config = document.validate(Config)
    if wrong := [document.make_problem(*each) for each in _find_sweep_problems(config)]:
        raise ConfigError(wrong)
    with _placing(document):
        yield config


@contextmanager
def load_sensors(path: Path) -> Iterator[Mapping[str, AnySensor]]:
    """Read a file with the section `sensors` alone, and add its lines to a `ConfigError` of the block.

    Raises:
        ConfigError: If the file cannot be read or anything in it is wrong, or the block raises one.
    """
    document = Document(path)
    sensors = document.validate(_SensorsOnly).sensors
    try:
        yield sensors
    except ConfigError as error:
        # Other arguments of the block are not in the file.
        if not all(problem.key.startswith("sensors.") for problem in error.problems):
            raise
        with _placing(document):
            raise


@contextmanager
def _placing(document: Document, key: str = "") -> Iterator[None]:
    """Add lines of the file to a `ConfigError` of the block, whose problems concern `key` if they name none."""
    try:
        yield
    except ConfigError as error:
        problems = [document.place(replace(problem, key=problem.key or key)) for problem in error.problems]
        raise type(error)(problems, expected=error.expected, hint=error.hint) from error


def dump_yaml(config: Config, *sections: str) -> str:
    """Write a configuration, or some sections of it, with all keys as YAML that loads back to an equal one.

    The text is part of every dataset, so it must not depend on the version of a library that writes YAML.
    """
    return "".join(f"{line}\n" for line in _write_lines(config.model_dump(include={*sections} or None), ""))


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
    section = values.get(str(location[0]))
    name = section.get("name") if isinstance(section, dict) else None
    holder: Any = None
    # Keys of the first level are sections or single values. Of a section, its name alone decides what the defaults are.
    with suppress(ValidationError):
        if len(location) > 1:
            holder = Config.model_validate({} if name is None else {location[0]: {"name": name}}, strict=True)
    for part in location:
        holder = getattr(holder, str(part), None)
    return holder if isinstance(holder, dict) else {}


def _find_robot(document: Document, directory: Path) -> Any:
    """Find the robot whose joints the values may name, and complete its section; None if its keys are wrong.

    Paths in the section are relative to the directory of the file.
    """
    given = document.values.get("robot", {})
    try:
        section = _RobotOnly.model_validate({"robot": given}, strict=True).robot
    except ValidationError:
        return None
    if isinstance(section, DescribedRobotConfig):
        section = section.below(directory)
    with _placing(document, "robot"):
        section = import_own("throwcollect.robots.importing:complete")(section)
    if isinstance(section, DescribedRobotConfig):
        document.values["robot"] = section
    return section.find()


def _find_motions(document: Document, directory: Path, robot: Any) -> None:
    """Complete the keys of a task whose motions are in a file, which may be relative to the directory."""
    task = document.values.get("task")
    if robot is None or not isinstance(task, dict):
        return
    given, start, end = (task.get(name, {}) for name in ("trajectory", "start", "end"))
    if not all(isinstance(each, dict) for each in (given, start, end)) or given.get("family") != "file":
        return
    with suppress(ValidationError):
        section = MotionFile.model_validate(given, strict=True)
        section = section.model_copy(update={"file": str(directory.absolute() / section.file)})
        keys = {"trajectory": section}
        if section.sha256 is None:
            with _placing(document):
                keys = import_own("throwcollect.tasks.motions:complete")(section, robot, start, end)
            # Joints that the file does not move start where they do without it.
            default = {} if "start" in task else _find_default(document.values, ("task", "start"))
            keys["start"] = {joint: default[joint] for joint in default if joint in robot.joints} | keys["start"]
        document.values["task"] = task | keys


def _find_bodies(document: Document, directory: Path) -> None:
    """Complete the sections of bodies whose shapes are in files, which may be relative to the directory."""
    scene = document.values.get("scene")
    bodies = scene.get("bodies") if isinstance(scene, dict) else {}
    if not isinstance(bodies, dict):
        return
    for name, given in bodies.items():
        with suppress(ValidationError):
            section = _BodyOnly.model_validate({"body": given}, strict=True).body
            if isinstance(section, FileBodyConfig):
                section = section.model_copy(update={"file": str(directory.absolute() / section.file)})
                with _placing(document, f"scene.bodies.{name}.file"):
                    bodies[name] = import_own("throwcollect.robots.body_files:complete")(section)


def read_robot_section(path: Path | None, overrides: Sequence[str] = ()) -> RobotConfig:
    """Read and complete the section `robot` of a file, or the one that overrides alone make.

    Raises:
        ConfigError: If the file cannot be read, the section is wrong, or its robot cannot be imported.
    """
    document = Document(path)
    for override in overrides:
        document.override(override)
    document.values = {"robot": document.values.get("robot", {})}
    _find_robot(document, Path() if path is None else path.parent)
    section: RobotConfig = document.validate(_RobotOnly).robot
    return section


class _RobotOnly(Section):
    robot: AnyRobot


class _BodyOnly(Section):
    body: AnyBody


class _SensorsOnly(Section):
    sensors: Sensors


def _find_sweep_problems(config: Config) -> Iterator[tuple[Location, str]]:
    sampler = config.sweep.sampler
    if config.sweep.parameters and sampler != "grid" and config.trials is None and config.until is None:
        wanted = f"or (until) how many should have {config.task.success}"
        yield ("trials",), f"missing; the sampler {sampler} should know how many trials to draw, {wanted}"
    for key, parameter in config.sweep.parameters.items():
        location: Location = (*PARAMETERS, key)
        if reason := reason_not_sweepable(config, key):
            yield location, reason
            continue
        if isinstance(parameter, Range):
            values: dict[Location, float] = {("min",): parameter.min, ("max",): parameter.max}
        else:
            values = {("values", index): value for index, value in enumerate(parameter.values)}
        for part, value in values.items():
            try:
                with_values(config, {key: value})
            except ConfigError as error:
                yield (*location, *part), error.problems[0].message


def _write_lines(values: dict[str, Any], indent: str) -> Iterator[str]:
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield f"{indent}{value_as_yaml(key)}:"
            yield from _write_lines(value, indent + "  ")
        else:
            yield f"{indent}{value_as_yaml(key)}: {value_as_yaml(value)}"
