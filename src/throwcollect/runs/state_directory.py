"""The directory in which this machine remembers what belongs to a user: runs, and the server that shows them."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

from throwcollect.errors import ConfigError

STATE_VARIABLE = "THROWCOLLECT_STATE"
"""Names the directory."""


def state_directory() -> Path:
    """A directory of this user alone; not that of the login, which vanishes when the last terminal is closed.

    Raises:
        ConfigError: If it cannot be made, or others own it or may write there.
    """
    named = os.environ.get(STATE_VARIABLE)
    try:
        path = Path(named).absolute() if named else Path(tempfile.gettempdir()) / f"throwcollect-{os.getuid()}"
    except FileNotFoundError as error:
        raise ConfigError(
            "runs cannot be remembered: no directory for temporary files can be written",
            hint=f"name a directory in {STATE_VARIABLE}",
        ) from error
    try:
        path.mkdir(mode=0o700, parents=bool(named), exist_ok=True)
        # A link that the user has named is the user's own choice.
        owner = path.stat(follow_symlinks=bool(named))
    except OSError as error:
        raise unusable(path, error) from error
    # In a directory that all may write to, somebody else may have been faster.
    if owner.st_uid != os.getuid() or owner.st_mode & (0o022 if named else 0o077):
        raise ConfigError(
            f"{path}: runs cannot be remembered there: it belongs to somebody else, or others may write there",
            hint=f"name another directory in {STATE_VARIABLE}, or remove it",
        )
    return path


def unusable(path: Path, error: OSError) -> ConfigError:
    """The error that says that a path of the directory cannot be used, and what helps."""
    hint = "free space there" if error.errno == errno.ENOSPC else "check who may write there"
    return ConfigError(
        f"{path}: runs cannot be remembered there: {error.strerror}",
        hint=f"{hint}, or name another directory in {STATE_VARIABLE}",
    )
