"""Decides which directories and devices of its host a container may have."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import PurePosixPath

_SYSTEM = (
    *("/bin", "/boot", "/dev", "/etc", "/lib", "/lib32", "/lib64", "/libx32", "/lost+found", "/proc"),
    *("/run", "/sbin", "/sys", "/usr", "/var/backups", "/var/cache", "/var/lib", "/var/lock", "/var/log", "/var/mail"),
    *("/var/run", "/var/spool"),
)
"""Directories of the system. Neither what is in them nor a directory that contains one of them may be mounted."""

_SHARED = ("/home", "/tmp", "/var/tmp")  # noqa: S108
"""Directories that all users and programs share; directories in them may be data."""

_HOME = re.compile("/root|/home/[^/]+")
"""Home directories. What begins with a dot in them belongs to programs, and is full of keys and passwords."""

_DEVICE = re.compile(r"/dev/(dri(/.+)?|nvidia[^/]*|nvidia-caps(/.+)?|kfd|dxg)")
"""Device files of graphics processors, with which a simulation may compute."""

DEVICES = "graphics processors alone: /dev/dri, /dev/nvidia*, /dev/kfd, /dev/dxg"


def refusal(path: str, *, more: Iterable[str] = ()) -> str | None:
    """Say why a directory or file of the host must not be mounted; None if it may be.

    Mounts are for data. What belongs to the system is refused even for reading, because it may hold secrets. The
    path is absolute and leads through no links; `more` are further directories of the system, such as those of the
    engine.
    """
    if path in _SHARED:
        return f"is refused, as all users of the machine share {path}; mounts are for data"
    for place in (*_SYSTEM, *more):
        if os.path.commonpath([path, place]) in (path, place):
            return f"is refused, as {place} belongs to the system; mounts are for data"
    if _HOME.fullmatch(path):
        return "is refused, as a home directory holds secrets; mounts are for data"
    hidden = next((part for part in PurePosixPath(path).parts if part.startswith(".")), None)
    return None if hidden is None else f"is refused, as {hidden} may hold secrets of programs; mounts are for data"


def is_allowed_device(path: str) -> bool:
    """Whether a device file, or a directory of them, may be handed over to a container; the path has no links."""
    return _DEVICE.fullmatch(path) is not None
