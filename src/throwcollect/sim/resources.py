"""Finds the descriptions of what can be spawned by their URIs, and the files that they refer to."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import quote

from throwcollect.engines.body import BodyModel
from throwcollect.errors import ConfigError, RequestError
from throwcollect.robots.robot import Robot
from throwcollect.robots.urdf import PACKAGE, locate_file
from throwcollect.sim.spawnable import read_model

_LARGEST_FILE = 4 * 2**20
_MOST_ENTRIES = 20_000


def load_model(uri: str, text: str, robot: Robot) -> BodyModel:
    """Read the description that a client names or sends.

    Args:
        uri: ``file://`` or ``package://`` URI of a URDF file.
        text: URDF text, which is used if there is no URI.
        robot: The robot; packages of ``package://`` are looked for where its description is installed.
    """
    if not uri:
        if not text:
            raise RequestError("NO_RESOURCE", "neither a URI nor a description was given")
        return read_model(text, lambda filename: _locate(filename, None, robot))
    path = _resolve(uri, robot, missing="RESULT_NOT_FOUND")
    if path.suffix.lower() != ".urdf":
        raise RequestError("UNSUPPORTED_FORMAT", f"{uri:.255}: a file of type {path.suffix!r:.20}", expected="*.urdf")
    try:
        if not path.is_file():
            raise RequestError("RESULT_NOT_FOUND", f"{path!s:.255}: no such file")
        if path.stat().st_size > _LARGEST_FILE:
            raise RequestError("RESOURCE_PARSE_ERROR", f"{path}: more than {_LARGEST_FILE} bytes")
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise RequestError("RESULT_NOT_FOUND", f"{path!s:.255}: cannot be read: {error}") from error
    return read_model(content, lambda filename: _locate(filename, path.parent, robot))


def find_resources(sources: Sequence[str], robot: Robot) -> tuple[dict[str, str], list[str]]:
    """Look for descriptions that can be spawned.

    Args:
        sources: URIs of directories to search besides the package of the robot's description.
        robot: The robot.

    Returns:
        The name that each description gives itself, by the URI of the description; and a sentence for each source that
        cannot be searched, with the reason.
    """
    names = dict(_find_installed(robot))
    useless = []
    for source in sources:
        try:
            directory = _resolve(source, robot, missing="RESULT_NOT_FOUND")
            if not directory.is_dir():
                raise RequestError("RESULT_NOT_FOUND", f"{source!r:.255}: no such directory")
            names |= _search(directory, Path.as_uri, robot)
        except (OSError, ValueError) as error:
            useless.append(f"{source!r:.255}: cannot be searched: {error}")
        except RequestError as error:
            useless.append(str(error))
    return names, useless


@cache
def _find_installed(robot: Robot) -> Mapping[str, str]:
    share = robot.share()

    def uri_of(path: Path) -> str:
        return f"package://{quote(path.relative_to(share).as_posix())}"

    return _search(share / _package_of(robot), uri_of, robot)


def _package_of(robot: Robot) -> str:
    """Name the package of the robot's description, which is a directory in the robot's share."""
    return robot.urdf.split("/", 1)[0]


def _search(directory: Path, uri_of: Callable[[Path], str], robot: Robot) -> dict[str, str]:
    """Find the descriptions below a directory that can be spawned; return their names by their URIs."""
    names = {}
    seen = 0
    for parent, directories, files in os.walk(directory):
        seen += len(files) + len(directories)
        if seen > _MOST_ENTRIES:
            raise RequestError("RESULT_NOT_FOUND", f"{directory}: more than {_MOST_ENTRIES} files; name a part of it")
        for path in (Path(parent, name) for name in files if name.endswith(".urdf")):
            try:
                if path.is_file() and path.stat().st_size <= _LARGEST_FILE:
                    names[uri_of(path)] = _read_name(path, robot)
            except (RequestError, OSError):
                # A description that cannot be spawned is left out of the list. A client that tries to spawn it is told
                # the reason.
                continue
    return names


def _read_name(path: Path, robot: Robot) -> str:
    """Read the name of a description, and check that it can be spawned."""
    model = read_model(path.read_bytes(), lambda name: _locate(name, path.parent, robot), load_meshes=False)
    return model.name or path.stem


def _locate(filename: str, directory: Path | None, robot: Robot) -> Path:
    """Find the file of a mesh, whose name may be a path relative to the directory of its description."""
    if directory is None and "://" not in filename and not filename.startswith("/"):
        message = f"mesh {filename!r:.255}: a relative path means nothing in a description without a file"
        raise RequestError("MISSING_ASSETS", message, expected="package:// or file://")
    is_url = "://" in filename
    path = _resolve(filename, robot, missing="MISSING_ASSETS") if is_url else (directory or Path("/")) / filename
    if not _is_file(path):
        raise RequestError("MISSING_ASSETS", f"{path!s:.255}: no such file")
    return path


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _resolve(uri: str, robot: Robot, *, missing: str) -> Path:
    """Find the file that a URI means; packages are looked for in the share of the robot."""
    try:
        path = locate_file(uri, robot.share())
    except ConfigError as error:
        raise RequestError("UNSUPPORTED_FORMAT", error.message, expected=error.expected) from error
    if uri.startswith(PACKAGE) and not (
        path.is_relative_to(share := robot.share())
        and path != share
        and (share / path.relative_to(share).parts[0]).is_dir()
    ):
        raise RequestError(missing, f"{uri!r:.255}: no such package", expected=f"{PACKAGE}{_package_of(robot)}/...")
    return path
