"""Keeps two processes from changing one dataset: a lock on its directory, on whatever machine the second process runs.

A process that prepares or resumes a dataset holds the lock alone, before it reads anything.
The launcher and the coordinator of a run hold it together while they live. So no process can prepare the dataset while
it is collected into, not even while a coordinator that was lost is started again.

Between its preparation and its launch, a run releases the lock for a moment. If another process takes it just then, the
run ends before it starts a node. If that process has released it by then and launches a run of its own, the journal
decides between the two, as only one coordinator can hold it (see `journal`). The winner reads configuration and plan
when no process can change them any more, so they fit each other.

It is a lock of the kernel (flock) on the directory itself. So it leaves no file behind, holds across containers and
other names of the directory, and ends with the process. On NFS, only processes of the same machine see it.

Some file systems of clusters have no locks. A dataset that is collected in slices needs none: an attempt at a slice has
a directory that only one process knows, and joining the slices, however often, makes the same dataset.
"""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from throwcollect.dataset.directory import ATTEMPT
from throwcollect.errors import DatasetError
from throwcollect.files import unreadable

PATIENCE_S = 5.0
"""How long to wait for a lock [s], as a process that was killed a moment ago may still hold it."""
_GLANCE_S = 0.1
"""How long a process of a run waits for a lock [s], as `is_locked` of another process may hold it for a moment."""
_RETRY_S = 0.05
_NO_LOCKS = frozenset({errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP})


@contextmanager
def hold_lock(directory: Path, *, alone: bool = True, needed: bool = True) -> Iterator[None]:
    """Keep others from changing a dataset while the block lasts.

    Args:
        directory: Its directory.
        alone: Whether no other process may hold the lock; the processes of a run hold it together.
        needed: Whether it has to be locked; if not, a file system without locks will do.
    """
    try:
        # A directory cannot be opened for writing, and flock does not ask for that.
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise unreadable(directory, error) from error
    try:
        lock(descriptor, directory, alone=alone, needed=needed)
        yield
    finally:
        # This also releases the lock.
        os.close(descriptor)


def lock(descriptor: int, directory: Path, *, alone: bool = True, needed: bool = True) -> None:
    """Lock an open file or directory of a dataset, as `hold_lock` does, until it is closed."""
    # A process of a run waits only as long as `is_locked` takes: if it waited for a preparation to end, it would go on
    # with another plan than it was started for.
    deadline = time.monotonic() + (PATIENCE_S if alone else _GLANCE_S)
    while True:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if time.monotonic() >= deadline:
                raise DatasetError(
                    "another process collects into it, or changes it",
                    path=directory,
                    hint="throwcollect ps lists the runs of this machine",
                ) from error
            time.sleep(_RETRY_S)
        except OSError as error:
            if error.errno in _NO_LOCKS and (not needed or ATTEMPT in directory.name):
                return
            raise DatasetError(
                f"cannot be locked: {error.strerror}",
                path=directory,
                hint="choose a directory on a file system that has locks (flock)",
            ) from error
        else:
            return


def is_locked(directory: Path) -> bool:
    """Whether a process collects into a dataset or changes it; False if the file system has no locks.

    This function takes the lock for a moment to find out.
    """
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False
    try:
        # The processes of a run share the lock, so only a request for it alone fails while they hold it.
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False
