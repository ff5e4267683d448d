"""The service of ROS# by which clients get the meshes of a robot, whose files they cannot see."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from throwcollect.errors import ConfigError
from throwcollect.robots.robot import Robot
from throwcollect.serve.rosbridge.service_calls import Call

GET_FILE = "file_server/get_file"
"""Name of the service, without a slash at its beginning."""

_PACKAGE = "package://"
_LARGEST = 64 * 2**20


def find_packages(robot: Robot) -> Mapping[str, Path]:
    """Find the packages that the description of a robot names.

    Args:
        robot: The robot.

    Returns:
        Directory of each package, by its name.

    Raises:
        ConfigError: If the description is not installed, or cannot be read.
    """
    try:
        text = robot.urdf_path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{robot.urdf_path}: cannot be read: {error}") from error
    return {name: robot.share() / name for name in set(re.findall(rf"{_PACKAGE}([\w.-]+)/", text))}


class FileServer:
    """Files of packages, for those who name them as ``package://NAME/PATH``.

    Args:
        packages: Directory of each package, by its name.
    """

    def __init__(self, packages: Mapping[str, Path]) -> None:
        self._packages = packages

    def answer(self, call: Call) -> None:
        """Answer with the bytes of a file.

        Raises:
            ConfigError: If there is no such file in a package of the robot.
        """
        data = self._read(call.fields.text("name"))
        call.reply({"value": base64.b64encode(data).decode() if call.form.compression == "none" else data})

    def _read(self, url: str) -> bytes:
        """Bytes of a file.

        Raises:
            ConfigError: If it lies elsewhere, is not there, or too large.
        """
        name, _, rest = url.removeprefix(_PACKAGE).partition("/")
        package = self._packages.get(name) if url.startswith(_PACKAGE) else None
        if package is None or ".." in PurePosixPath(rest).parts:
            known = ", ".join(f"{_PACKAGE}{each}/..." for each in sorted(self._packages))
            raise ConfigError(f"{url}: not a file of the robot's description", expected=known or "a robot with meshes")
        try:
            path = (package / rest).resolve(strict=True)
            if not (path.is_relative_to(package.resolve()) and path.is_file() and path.stat().st_size <= _LARGEST):
                raise ConfigError(f"{url}: no file of that package, or larger than {_LARGEST >> 20} MiB")
            return path.read_bytes()
        except (OSError, ValueError) as error:
            raise ConfigError(f"{url}: cannot be read: {error}") from error
