"""Files that appear whole or not at all, and write errors that say what is wrong."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from throwcollect.errors import DatasetError

_HINTS = {
    errno.ENOSPC: "free space on that disk",
    errno.EDQUOT: "free space within your quota",
    errno.EFBIG: "raise the limit on file sizes (ulimit -f), or lower record.trials_per_shard",
    errno.EACCES: "check who may write there",
    errno.EROFS: "choose a directory that can be written",
}


def unwritable(path: Path, error: OSError) -> DatasetError:
    """The error that says that a path cannot be written, and why."""
    # Some libraries fill the text of an error with their own; the number is the system's.
    reason = os.strerror(error.errno) if error.errno else error
    return DatasetError(f"{path}: cannot be written: {reason}", hint=_HINTS.get(error.errno or 0))


@contextmanager
def replacing(path: Path) -> Iterator[int]:
    """A new file that takes the place of `path` when the block ends well, and vanishes when it does not.

    Args:
        path: The file; while it is written its contents are beside it, in ``<name>.new``.

    Yields:
        File descriptor to write to.

    Raises:
        DatasetError: If the file cannot be written.
    """
    beside = path.with_name(f"{path.name}.new")
    try:
        descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            yield descriptor
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(beside, path)
        sync_directory(path.parent)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        with suppress(OSError):
            beside.unlink()


def remove(path: Path) -> None:
    """Remove a file, if it is there.

    Raises:
        DatasetError: If it cannot be removed.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be removed: {error.strerror}") from error


def sync_directory(directory: Path) -> None:
    """Make names in a directory survive a power cut.

    Raises:
        OSError: If the directory cannot be opened or synchronised.
    """
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_all(descriptor: int, data: bytes) -> None:
    """Write all bytes, however many calls it takes.

    Raises:
        OSError: If the system writes no more of them.
    """
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def read_text(path: Path, *, most_bytes: int) -> str:
    """UTF-8 text of a file.

    Raises:
        DatasetError: If it is missing, no file, no such text, or larger than `most_bytes`.
    """
    try:
        # Opening a pipe would wait for somebody to write into it.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            data = file.read(most_bytes + 1)
        if len(data) > most_bytes:
            raise DatasetError(f"{path}: cannot be read: larger than {most_bytes} bytes")
        return data.decode("utf-8")
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DatasetError(f"{path}: cannot be read: no UTF-8 text: byte {error.start}") from error


def write_file(path: Path, data: bytes) -> None:
    """Write a whole file at once, in place of any file of that name.

    Raises:
        DatasetError: If it cannot be written.
    """
    with replacing(path) as descriptor:
        write_all(descriptor, data)
