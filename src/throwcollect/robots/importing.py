"""Finds the robot of a configuration, and imports one that a URDF describes: cleans the URDF, derives what it lacks.

The result is a directory. It has a URDF of the joints that controllers command, an SRDF with the posture at rest and
the links that may overlap, meshes by the digests of their contents, and ``robot.yaml``: a section `robot` in which
every key has its value, with a comment on where it came from.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from throwcollect.config.document import Document
from throwcollect.config.loader import value_as_yaml
from throwcollect.config.robot_config import DescribedRobotConfig, RobotConfig
from throwcollect.errors import ConfigError
from throwcollect.files import suggest_path
from throwcollect.members import load_member
from throwcollect.robots.imported import (
    SRDF,
    URDF,
    find_examples,
    find_mesh,
    hash_files,
    list_shares,
    make_error,
    make_robot,
)
from throwcollect.robots.robot import Robot
from throwcollect.robots.urdf import PACKAGE, read_xml
from throwcollect.state_directory import state_directory
from throwcollect.version import __version__


def find_robot(of: RobotConfig | str) -> Robot:
    """Find the robot of a section, or of the name of an installed robot."""
    section = complete(of)
    if isinstance(section, DescribedRobotConfig):
        return make_robot(section)
    robot: Robot = load_member("robots", section.name)
    return robot


def complete(of: RobotConfig | str) -> RobotConfig:
    """Import the robot of a section that only names it or its URDF: all keys get their values, and paths are absolute.

    Sections that are complete, and those of robots that are no URDF alone, are returned as they are.
    """
    section = RobotConfig.model_construct(name=of) if isinstance(of, str) else of
    if not isinstance(section, DescribedRobotConfig):
        member = load_member("robots", section.name)
        if isinstance(member, Robot):
            return section
        own = {name: getattr(section, name) for name in section.model_fields_set - {"name"}}
        section = member.model_copy(update=own)
    return section if section.sha256 is not None else import_robot(section)


SECTION = "robot.yaml"
_EXAMPLES = "example-robot-data:"


def import_robot(section: DescribedRobotConfig) -> DescribedRobotConfig:
    """Import a robot, unless it has been imported before, and complete its section."""
    path = find_urdf(section.urdf)
    directory = _find_cache(section, path)
    if not _is_whole(directory):
        # Cleaners of temporary directories remove files and leave their directories.
        shutil.rmtree(directory, ignore_errors=True)
        _fill(directory, section, path)
    found = Document(directory / SECTION).values["robot"]
    files = {"urdf": str(directory / URDF), "srdf": str(directory / SRDF), "sha256": hash_files(directory)}
    kept = {key: getattr(section, key) for key in section.model_fields_set - _DERIVED}
    return DescribedRobotConfig.model_validate({**found, **files, **kept})


def _is_whole(directory: Path) -> bool:
    return all((directory / name).is_file() for name in (URDF, SRDF, SECTION))


_DERIVED = {
    *("name", "urdf", "srdf", "packages", "flange", "tool_pose", "controllers", "fixed", "home", "limits", "gripper"),
    *("prismatic", "holding", "sha256"),
}


def find_urdf(urdf: str) -> Path:
    """Find the file that the key `robot.urdf` names."""
    if urdf.startswith(_EXAMPLES):
        path = find_examples() / "example-robot-data/robots" / urdf.removeprefix(_EXAMPLES)
    elif urdf.startswith(PACKAGE):
        package, _, rest = urdf.removeprefix(PACKAGE).partition("/")
        path = next((share / rest for share in list_shares(package)), Path(urdf))
    else:
        path = Path(urdf)
    if not path.is_file():
        wrong = "is a directory" if path.is_dir() else "no such file"
        near = "" if path.is_dir() or ":" in urdf else suggest_path(path)
        where = path if path.is_absolute() else urdf
        raise make_error("urdf", f"{where}: {wrong}{near}", hint="docs/robots.md explains how to describe a robot")
    return path


def _find_cache(section: DescribedRobotConfig, path: Path) -> Path:
    """Find the directory of an import: its name is a digest of the section, the URDF, the SRDF and all meshes."""
    digest = hashlib.sha256(f"{__version__}\n{section.model_dump_json(include=_DERIVED)}\n{path}".encode())
    urdf = read_xml(path)
    for root in (urdf, *([read_xml(Path(section.srdf))] if section.srdf else ())):
        digest.update(ElementTree.tostring(root))
    for filename in sorted({mesh.get("filename", "") for mesh in urdf.iterfind("link/*/geometry/mesh")} - {""}):
        # Meshes may be large, so their contents are not looked at. One that is missing is an error of its link, later.
        with suppress(ConfigError):
            status = find_mesh(filename, path, section.packages).stat()
            digest.update(f"\n{filename} {status.st_size} {status.st_mtime_ns}".encode())
    return state_directory() / "robots" / digest.hexdigest()[:16]


def _fill(directory: Path, section: DescribedRobotConfig, path: Path) -> None:
    """Write the files of an import; they appear all at once."""
    from throwcollect.robots.cleaning import Cleaning
    from throwcollect.robots.derived import derive

    made = Cleaning(section, path)
    model = made.clean()
    directory.parent.mkdir(exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=".import-", dir=directory.parent))
    try:
        (scratch / URDF).write_text(made.write(model), encoding="utf-8")
        for name, content in made.files.items():
            (scratch / name).write_bytes(content)
        keys = made.complete()
        robot = make_robot(DescribedRobotConfig.model_validate({**keys, "urdf": str(scratch / URDF)}))
        srdf, made.notes["srdf"] = derive(robot, section)
        (scratch / SRDF).write_text(srdf, encoding="utf-8")
        (scratch / SECTION).write_text("".join(_write_section(keys, made.notes)), encoding="utf-8")
        try:
            scratch.rename(directory)
        except OSError:
            # Another process has imported the same robot meanwhile.
            if not _is_whole(directory):
                raise
    except ConfigError as error:
        # The user knows the source, and not the copy.
        known = [replace(each, message=each.message.replace(str(scratch / URDF), str(path))) for each in error.problems]
        raise ConfigError(known, expected=error.expected, hint=error.hint) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _write_section(keys: Mapping[str, object], notes: Mapping[str, str]) -> Iterator[str]:
    yield "robot:\n"
    for key, value in keys.items():
        yield f"  {key}: {value_as_yaml(value)} # {notes[key]}\n"
