"""What a container may see of its host: which directories can be mounted, and which devices handed over."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import PurePosixPath

_SYSTEM = (
    *("/bin", "/boot", "/dev", "/etc", "/lib", "/lib32", "/lib64", "/libx32", "/lost+found", "/proc", "/root/.ssh"),
    *("/run", "/sbin", "/sys", "/usr", "/var/backups", "/var/cache", "/var/lib", "/var/lock", "/var/log", "/var/mail"),
    *("/var/run", "/var/spool"),
)
"""Directories by which a machine is run; nothing in them, and nothing that holds them, is data."""

_SHARED = ("/home", "/tmp", "/var/tmp")  # noqa: S108
"""Directories in which all users and programs keep something; what is in them may be data."""

SECRETS = (".aws", ".azure", ".docker", ".gnupg", ".kube", ".netrc", ".password-store", ".ssh")
"""What home directories hold besides data."""

_DEVICE = re.compile(r"/dev/(dri(/.+)?|nvidia[^/]*|nvidia-caps(/.+)?|kfd|dxg)")
"""Graphics processors, which a simulation may compute with."""

DEVICES = "graphics processors alone: /dev/dri, /dev/nvidia*, /dev/kfd, /dev/dxg"


def normal_path(text: str) -> str:
    """An absolute path without repeated and trailing slashes."""
    return str(PurePosixPath(re.sub("/+", "/", text)))


def refusal(path: str, *, more: Iterable[str] = ()) -> str | None:
    """Why a directory or file of the host must not be mounted; None if it may be.

    Mounts are for data, so whatever belongs to the system is refused, whether it could be written or not: reading it
    gives secrets away.

    Args:
        path: An absolute path.
        more: Further directories that belong to the system, such as the engine's own.
    """
    plain = normal_path(path)
    if plain in _SHARED:
        return f"is refused, as all users of the machine share {plain}; mounts are for data"
    for place in (*_SYSTEM, *more):
        if os.path.commonpath([plain, place]) in (plain, place):
            return f"is refused, as {place} belongs to the system; mounts are for data"
    secret = next((part for part in PurePosixPath(plain).parts if part in SECRETS), None)
    return None if secret is None else f"is refused, as {secret} holds secrets; mounts are for data"


def is_allowed_device(path: str) -> bool:
    """Whether a device file, or a directory of them, may be handed over to a container."""
    return _DEVICE.fullmatch(normal_path(path)) is not None and ".." not in path.split("/")
