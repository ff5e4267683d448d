"""The directory of a user's files that outlive a command: the records of runs, and the server that shows them."""

from __future__ import annotations

import errno
import fcntl
import os
import tempfile
from pathlib import Path

from throwcollect.errors import ConfigError

STATE_VARIABLE = "THROWCOLLECT_STATE"
"""Environment variable that names the directory."""


def state_directory() -> Path:
    """Path of the directory, which is made if it does not exist.

    By default it lies in the directory for temporary files, because ``XDG_RUNTIME_DIR`` vanishes at the last logout.
    """
    named = os.environ.get(STATE_VARIABLE)
    path = Path(named).absolute() if named else Path(tempfile.gettempdir()) / f"throwcollect-{os.getuid()}"
    try:
        path.mkdir(mode=0o700, parents=bool(named), exist_ok=True)
        # A link is followed only if the user has named it: in /tmp, another user may have put one there.
        status = path.stat(follow_symlinks=bool(named))
    except OSError as error:
        raise unusable(path, error) from error
    # All users may write to /tmp, so another one may have made the directory first.
    if status.st_uid != os.getuid() or status.st_mode & (0o022 if named else 0o077):
        raise ConfigError(
            f"{path}: runs cannot be remembered there: it belongs to another user, or others may write there",
            hint=f"name another directory in {STATE_VARIABLE}, or remove it",
        )
    return path


def unusable(path: Path, error: OSError) -> ConfigError:
    """The error that a path in the directory cannot be used, with a hint."""
    hint = "free space there" if error.errno == errno.ENOSPC else "check who may write there"
    return ConfigError(
        f"{path}: runs cannot be remembered there: {error.strerror}",
        hint=f"{hint}, or name another directory in {STATE_VARIABLE}",
    )


def is_locked(path: Path) -> bool:
    """Whether a process holds the lock of a file, as a launcher does as long as it lives.

    Unlike a process id, a lock cannot outlive its process or pass to another one. This function takes the lock for a
    moment to find out.
    """
    try:
        lock = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        # A shared lock is enough to find out, and two processes that do so at once do not hinder each other.
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False
