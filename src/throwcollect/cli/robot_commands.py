"""`throwcollect robot`: imports robots from their URDF, checks and lists them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import JsonOption
from throwcollect.cli.printing import show
from throwcollect.errors import ConfigError
from throwcollect.wording import command, suggest

if TYPE_CHECKING:
    from throwcollect.config.robot_config import RobotConfig

RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="Name of an installed robot, a robot.yaml or its directory, or a URDF with --flange."
    ),
]
FlangeOption = Annotated[str | None, typer.Option("--flange", metavar="LINK", help="Link that holds the tool.")]
KeysOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="A key of the section robot, such as fixed.torso_lift_joint=0.15."),
]


def import_(
    robot: RobotArgument, *, flange: FlangeOption = None, output: Path | None = None, settings: KeysOption = None
) -> None:
    """Write a directory with a cleaned URDF, an SRDF, meshes, and a robot.yaml with the source of each value.

    Options:
        output (-o --output DIR): Directory to write; robots/NAME by default.
    """
    from throwcollect.robots.imported import list_files
    from throwcollect.robots.importing import SECTION

    section = read_robot(robot, flange, settings)
    source = _find_directory(section, robot)
    directory = output or Path("robots", section.name)
    if directory.exists():
        raise ConfigError(f"{directory}: is there already", hint="choose another one with --output")
    directory.mkdir(parents=True)
    for path in (source / SECTION, *list_files(source)):
        shutil.copyfile(path, directory / path.name)
    typer.echo((directory / SECTION).read_text(encoding="utf-8"), nl=False)
    for sentence in _list_oddities(section):
        typer.echo(f"odd: {sentence}")
    typer.echo(f"{directory}: written. A configuration with a throw that lands is made by:")
    typer.echo(f"  {command('init', '--robot', directory)}")


def check(
    robot: RobotArgument, *, flange: FlangeOption = None, settings: KeysOption = None, json: JsonOption = False
) -> None:
    """List what is odd about a robot: limits, masses, inertias, meshes, its posture at rest, its reach."""
    section = read_robot(robot, flange, settings)
    found = _list_oddities(section)
    show(found, *(found or [f"{section.name}: nothing is odd"]), json=json)


def list_(*, json: JsonOption = False) -> None:
    """List the robots that are installed."""
    from throwcollect.members import load_member, usable_names

    found = {name: load_member("robots", name).controllers for name in usable_names("robots")}
    lines = [f"{name:<12} {sum(map(len, each.values()))} joints: {', '.join(each)}" for name, each in found.items()]
    show({name: dict(each) for name, each in found.items()}, *lines, json=json)


def read_robot(robot: str, flange: str | None = None, settings: list[str] | None = None) -> RobotConfig:
    """Read the complete section of the robot that a command names."""
    from throwcollect.config.loader import read_robot_section, value_as_yaml
    from throwcollect.members import names_of
    from throwcollect.robots.importing import SECTION

    path, keys = Path(robot), [f"robot.{each}" for each in settings or ()]
    if robot in names_of("robots"):
        return read_robot_section(None, [f"robot.name={robot}", *keys])
    if path.is_dir() or path.suffix in (".yaml", ".yml"):
        return read_robot_section(path / SECTION if path.is_dir() else path, keys)
    if not flange and path.is_file():
        raise ConfigError(f"{robot}: a URDF needs the link that holds the tool", hint="name it: --flange LINK")
    if not flange:
        known = suggest(robot, names_of("robots"))
        raise ConfigError(
            f"{robot}: no such robot is installed{known}", hint="docs/robots.md explains how to describe a robot"
        )
    given = {"urdf": robot, "flange": flange}
    return read_robot_section(None, [*(f"robot.{key}={value_as_yaml(each)}" for key, each in given.items()), *keys])


def write_robot(robot: str, section: RobotConfig) -> list[str]:
    """Write the lines of the section of a configuration in this directory for the robot that a command names."""
    from throwcollect.config.loader import value_as_yaml
    from throwcollect.robots.importing import SECTION

    if robot == section.name:
        return [f"name: {robot} # `throwcollect robot list` lists others"]
    path = Path(robot)
    if not (path.is_dir() or path.suffix in (".yaml", ".yml")):
        values = {key: getattr(section, key) for key in ("name", "flange")}
        return [f"urdf: {value_as_yaml(robot)}", *(f"{key}: {value_as_yaml(each)}" for key, each in values.items())]
    file = path / SECTION if path.is_dir() else path
    lines = file.read_text(encoding="utf-8").splitlines()[1:]
    # Paths in the file are relative to it, and those in a configuration to the configuration.
    place = {f"  {key}: robot.": f"  {key}: {(file.parent / 'robot.').as_posix()}" for key in ("urdf", "srdf")}
    for old, new in place.items():
        lines = [line.replace(old, new) for line in lines]
    return [line.removeprefix("  ") for line in lines]


def _find_directory(section: RobotConfig, robot: str) -> Path:
    from throwcollect.config.robot_config import DescribedRobotConfig

    if not isinstance(section, DescribedRobotConfig):
        raise ConfigError(f"{robot}: is no robot that a URDF alone describes")
    return Path(section.urdf).parent


def _list_oddities(section: RobotConfig) -> list[str]:
    from throwcollect.robots.oddities import find_oddities

    return list(find_oddities(section.find()))
