"""The service of ROS# by which clients get the meshes of a robot, whose files they cannot see."""

from __future__ import annotations

import base64

from throwcollect.errors import ConfigError
from throwcollect.robots.urdf import PACKAGE
from throwcollect.serve.robot_files import find_mesh
from throwcollect.serve.rosbridge.service_calls import Call

GET_FILE = "file_server/get_file"
"""Name of the service, without a slash at its beginning."""

_LARGEST = 64 * 2**20


def give_file(call: Call) -> None:
    """Answer a call with the bytes of a mesh that it names as ``package://NAME/PATH``."""
    url = call.fields.text("name")
    name, _, rest = url.removeprefix(PACKAGE).partition("/")
    if not url.startswith(PACKAGE):
        raise ConfigError(f"{url}: not a file of a robot's description", expected=f"{PACKAGE}NAME/PATH")
    path = find_mesh(name, rest)
    try:
        if path.stat().st_size > _LARGEST:
            raise ConfigError(f"{url}: is larger than {_LARGEST >> 20} MiB")
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{url}: cannot be read: {error}") from error
    call.reply({"value": base64.b64encode(data).decode() if call.form.compression == "none" else data})
