"""Keeps two processes from changing one dataset: a lock on its directory, wherever the second of them runs.

A process that prepares a dataset, resumes it or rebuilds files of it holds the lock alone, before it reads anything.
The launcher and the coordinator of a run hold it together as long as they live. So nobody can prepare the dataset while
it is collected into, not even while a coordinator that was lost is started again.

Between its preparation and its launch a run lets go for a moment. If another process takes the lock just then, the run
ends before anything is started; and should that other one be ready by then and launch a run, too, then the journal,
which only one coordinator can hold (see `journal`), decides between the two. Whichever that is, it reads configuration
and plan when nobody can change them any more, and they fit each other.

The lock is one of the kernel (flock) on the directory itself. So it leaves nothing behind, holds across containers and
other names of the directory, and goes with the process. On NFS it is known to the processes of one machine alone.

Some file systems of clusters have no locks. A dataset that is collected in slices needs none: an attempt at a slice has
a directory that one process alone knows, and joining comes out the same however often and by whomever it is done.
"""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from throwcollect.dataset.directory import is_attempt
from throwcollect.errors import DatasetError
from throwcollect.files import unreadable

PATIENCE_S = 5.0
"""How long to wait for a lock [s]: a process that was killed a moment ago may still hold it."""
_RETRY_S = 0.05
_NO_LOCKS = frozenset({errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP})


@contextmanager
def hold_alone(directory: Path, *, needed: bool = True) -> Iterator[None]:
    """Keep all others from changing a dataset while the block lasts.

    Args:
        directory: Its directory.
        needed: Whether it has to be locked; if not, a file system without locks will do.

    Raises:
        DatasetError: If another process changes it, or it cannot be locked.
    """
    with _hold(directory, alone=True, needed=needed):
        yield


@contextmanager
def hold_together(directory: Path) -> Iterator[None]:
    """Keep all others but the processes of a run from changing its dataset while the block lasts.

    Args:
        directory: Directory of the dataset.

    Raises:
        DatasetError: If another process changes it, or it cannot be locked.
    """
    with _hold(directory, alone=False):
        yield


def lock(descriptor: int, directory: Path, *, alone: bool = True, needed: bool = True) -> None:
    """Lock an open file or directory of a dataset until it is closed.

    Args:
        descriptor: Its descriptor.
        directory: Directory of the dataset, for messages.
        alone: Whether no other process may hold the lock.
        needed: Whether it has to be locked; if not, a file system without locks will do, as it does for an attempt at a
            slice.

    Raises:
        DatasetError: If another process holds it, or it cannot be locked.
    """
    # A preparation that goes on just now makes a run begin with another plan; that is nothing to wait for.
    deadline = time.monotonic() + (PATIENCE_S if alone else 0.0)
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
            if error.errno in _NO_LOCKS and (not needed or is_attempt(directory)):
                return
            raise DatasetError(
                f"cannot be locked: {error.strerror}",
                path=directory,
                hint="choose a directory on a file system that has locks (flock)",
            ) from error
        else:
            return


@contextmanager
def _hold(directory: Path, *, alone: bool, needed: bool = True) -> Iterator[None]:
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise unreadable(directory, error) from error
    try:
        lock(descriptor, directory, alone=alone, needed=needed)
        yield
    finally:
        os.close(descriptor)
