"""A directory for what one process alone needs, such as a key; it is removed however that process ends.

A process that is killed cannot remove it, so the next one does. Whoever lives holds a lock (flock) on its directory.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

_YOUNG_S = 60.0
"""A directory that is younger may not be locked yet."""


@contextmanager
def make_own_directory(prefix: str) -> Iterator[Path]:
    """Make a directory for temporary files that nobody else can read, and remove those of processes that were killed.

    Args:
        prefix: What the names of all such directories begin with.

    Yields:
        The directory; it is gone after the block.
    """
    path = Path(tempfile.mkdtemp(prefix=prefix))
    try:
        with ExitStack() as held:
            with suppress(OSError):  # where there are no locks, none is removed by others
                held.enter_context(_hold(path))
            for other in path.parent.glob(f"{prefix}*"):
                if other != path:
                    _remove_abandoned(other)
            yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _remove_abandoned(directory: Path) -> None:
    """Remove the directory of a process of this user that has ended; whatever else it is, it stays."""
    with suppress(OSError):
        status = directory.lstat()
        if status.st_uid == os.getuid() and time.time() - status.st_mtime > _YOUNG_S:
            with _hold(directory):
                shutil.rmtree(directory, ignore_errors=True)


@contextmanager
def _hold(directory: Path) -> Iterator[None]:
    """Hold the lock of a directory.

    Raises:
        OSError: If it is no directory, another process holds it, or its file system has no locks.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)
