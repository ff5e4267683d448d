"""A directory for temporary files of one process, such as a key, which must not stay after the process has ended.

A process that is killed cannot remove its directory, so the next process does. A process that lives holds a lock on its
directory.
"""

from __future__ import annotations

import fcntl
import glob
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

_YOUNG_S = 60.0
"""A younger directory is left alone, because its process may not have locked it yet."""


@contextmanager
def make_own_directory(prefix: str, parent: Path | None = None) -> Iterator[Path]:
    """Make a directory that only this user can read, and remove directories of the same prefix that were abandoned.

    Args:
        prefix: How its name begins; nothing else of this user in that place may have a name that begins like this.
        parent: Where to make it; None for the place of temporary files.

    Yields:
        The directory; it is removed after the block.
    """
    path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        with ExitStack() as held:
            with suppress(OSError):  # without locks, other processes cannot hold this directory either, so it stays
                held.enter_context(_hold(path))
            for other in path.parent.glob(f"{glob.escape(prefix)}*"):
                if other != path:
                    _remove_abandoned(other)
            yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _remove_abandoned(directory: Path) -> None:
    """Remove a path if it is the directory of a process of this user that has ended."""
    with suppress(OSError):
        status = directory.lstat()
        if status.st_uid == os.getuid() and time.time() - status.st_mtime > _YOUNG_S:
            with _hold(directory):
                shutil.rmtree(directory, ignore_errors=True)


@contextmanager
def _hold(directory: Path) -> Iterator[None]:
    """Hold the lock of a directory."""
    # Everybody may write to /tmp, so somebody may have put a link at this path, to a directory of this user.
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)
