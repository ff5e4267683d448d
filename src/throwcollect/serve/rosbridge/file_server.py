"""The service of ROS# by which clients get the meshes of a robot, whose files they cannot see."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

from throwcollect.errors import ConfigError
from throwcollect.serve.rosbridge.service_calls import Call

GET_FILE = "file_server/get_file"
"""Name of the service, without a slash at its beginning."""

_PACKAGE = "package://"
_LARGEST = 64 * 2**20


class FileServer:
    """Files of packages, for those who name them as ``package://NAME/PATH``.

    Args:
        find: Finds a file by the name of its package and its path there; raises `NotFoundError` if there is none.
    """

    def __init__(self, find: Callable[[str, str], Path]) -> None:
        self._find = find

    def answer(self, call: Call) -> None:
        """Answer with the bytes of a file.

        Raises:
            ConfigError: If there is no such file in a package of a robot.
        """
        data = self._read(call.fields.text("name"))
        call.reply({"value": base64.b64encode(data).decode() if call.form.compression == "none" else data})

    def _read(self, url: str) -> bytes:
        """Bytes of a file.

        Raises:
            ConfigError: If it lies elsewhere, is not there, or too large.
        """
        name, _, rest = url.removeprefix(_PACKAGE).partition("/")
        if not url.startswith(_PACKAGE):
            raise ConfigError(f"{url}: not a file of a robot's description", expected=f"{_PACKAGE}NAME/PATH")
        path = self._find(name, rest)
        try:
            if path.stat().st_size > _LARGEST:
                raise ConfigError(f"{url}: is larger than {_LARGEST >> 20} MiB")
            return path.read_bytes()
        except OSError as error:
            raise ConfigError(f"{url}: cannot be read: {error}") from error
