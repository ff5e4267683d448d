"""Decides which directories and devices of its host a container may have."""

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
"""Directories of the system. Neither what is in them nor a directory that contains one of them may be mounted."""

_SHARED = ("/home", "/tmp", "/var/tmp")  # noqa: S108
"""Directories that all users and programs share; directories in them may be data."""

SECRETS = (".aws", ".azure", ".docker", ".gnupg", ".kube", ".netrc", ".password-store", ".ssh")
"""Names of files and directories with secrets in home directories."""

_DEVICE = re.compile(r"/dev/(dri(/.+)?|nvidia[^/]*|nvidia-caps(/.+)?|kfd|dxg)")
"""Device files of graphics processors, with which a simulation may compute."""

DEVICES = "graphics processors alone: /dev/dri, /dev/nvidia*, /dev/kfd, /dev/dxg"


def normal_path(text: str) -> str:
    """Write an absolute path without repeated and trailing slashes."""
    # `PurePosixPath` itself keeps two slashes at the beginning, which POSIX lets mean something else.
    return str(PurePosixPath(re.sub("/+", "/", text)))


def refusal(path: str, *, more: Iterable[str] = ()) -> str | None:
    """Say why a directory or file of the host must not be mounted; None if it may be.

    Mounts are for data. What belongs to the system is refused even for reading, because it may hold secrets. The
    path is absolute; `more` are further directories of the system, such as those of the engine.
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
