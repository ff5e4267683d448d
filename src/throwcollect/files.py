"""Writes files that appear whole or not at all, opens them only where they seem to lie, and makes errors for both.

A dataset may come from a stranger, so a name in its directory may be a symbolic link to any file of the user, or a pipe
that blocks the process that opens it. Nothing here follows such a name: a file is read, written or cut only if it is a
regular file in the very directory in which it is looked for. The user chooses that directory, so its own path may go
through links.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from throwcollect.errors import ConfigError, DatasetError
from throwcollect.wording import did_you_mean, find_near

StrPath = str | os.PathLike[str]
"""A path, for functions that other programs call."""

_MOVE_HERE = "put the file itself, or a copy of it, in that place; or remove it"
_HINTS = {
    errno.ENOSPC: "free space on that disk",
    errno.EDQUOT: "free space within your quota",
    errno.EACCES: "check who may write there",
    errno.EROFS: "choose a directory that can be written",
    errno.ELOOP: _MOVE_HERE,
    errno.ENXIO: _MOVE_HERE,
}
_REASONS = {
    errno.ELOOP: "a symbolic link leads elsewhere",
    errno.ENXIO: "not a file",
}
"""What these error numbers mean here; the system's own texts are about other cases."""


def unwritable(path: Path, error: OSError) -> DatasetError:
    """Make the error that a path cannot be written."""
    return DatasetError(f"cannot be written: {_find_reason(error)}", path=path, hint=_HINTS.get(error.errno or 0))


def unreadable(path: Path, error: OSError) -> DatasetError:
    """Make the error that a path cannot be read."""
    hint = _MOVE_HERE if error.errno in _REASONS else None
    return DatasetError(f"cannot be read: {_find_reason(error)}", path=path, hint=hint)


def _find_reason(error: OSError) -> str:
    # Some libraries put a text of their own into the error, but keep the error number of the system.
    number = error.errno or 0
    return _REASONS.get(number) or (os.strerror(number) if number else str(error))


def suggest_path(path: Path) -> str:
    """Write the end of a message on a file or directory that does not exist: which ones in its place may be meant."""
    names = os.listdir(path.parent) if path.parent.is_dir() and not path.exists() else []
    return did_you_mean([str(path.with_name(each)) for each in find_near(path.name, names)])


def open_regular(path: Path, flags: int = os.O_RDONLY, *, folder: int | None = None) -> int:
    """Open a regular file and return its descriptor; a link is not followed, and a pipe does not block.

    Args:
        path: The file; only its name if `folder` is given.
        flags: As for `os.open`.
        folder: Descriptor of the file's directory; None if the directory is in `path`.
    """
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666, dir_fd=folder)
    # The open file is examined, because its name may stand for another file by now.
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.ENXIO, _REASONS[errno.ENXIO], str(path))
    return descriptor


def open_log(path: Path, flags: int = os.O_WRONLY | os.O_CREAT | os.O_APPEND) -> int:
    """Open a file in a folder of its own, such as ``logs``, which must not be a link.

    The flags are as for `open_regular`. With ``os.O_CREAT`` among them, file and folder are made if they are missing.
    """
    if path.parent.is_symlink():
        raise OSError(errno.ELOOP, _REASONS[errno.ELOOP], str(path.parent))
    if flags & os.O_CREAT:
        path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        return open_regular(Path(path.name), flags, folder=folder)
    finally:
        os.close(folder)


def check_regular(path: Path) -> None:
    """Reject links, pipes and directories before another library opens a file; it reports all other errors."""
    try:
        os.close(open_regular(path))
    except OSError as error:
        if error.errno in _REASONS:
            raise unreadable(path, error) from error


@contextmanager
def beside(path: Path, *, mode: int = 0o666) -> Iterator[int]:
    """Open a new file that takes the place of `path` if the block ends well, and vanishes if it does not.

    While the file is written, it is called ``<name>.new``. A file that already has that name was left by a process that
    was killed, or put there by another program, and is removed. The umask of the process is applied to the mode.

    Yields:
        File descriptor to write to.
    """
    new = path.with_name(f"{path.name}.new")
    new.unlink(missing_ok=True)
    # O_EXCL fails if another program has put a file or a link there since the removal.
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, mode)
    try:
        try:
            yield descriptor
        finally:
            os.close(descriptor)
        os.replace(new, path)
    # No half-written file shall stay, not even after Ctrl-C, which is no `Exception`.
    except BaseException:
        new.unlink(missing_ok=True)
        raise


@contextmanager
def replacing(path: Path, *, mode: int = 0o666) -> Iterator[int]:
    """Open a new file as `beside` does; once the block has ended, the file survives a power cut.

    Yields:
        File descriptor to write to.
    """
    try:
        with beside(path, mode=mode) as descriptor:
            yield descriptor
            os.fsync(descriptor)
        sync_directory(path.parent)
    except OSError as error:
        raise unwritable(path, error) from error


@contextmanager
def new_directory(path: Path) -> Iterator[Path]:
    """Make a directory that gets its name if the block ends well, and vanishes if it does not.

    What a process that was killed has left of one of the same name vanishes, too. There must be nothing of that name,
    or only an empty directory. Errors of the block name its files as they would have been called, because only
    this function knows the hidden directory.

    Yields:
        A directory in a hidden one next to `path`, to write into meanwhile.
    """
    try:
        if path.exists() and not (path.is_dir() and not any(path.iterdir())):
            raise ConfigError(f"{path}: exists", expected="a directory that is new or empty")
        path.parent.mkdir(parents=True, exist_ok=True)
        # The hidden directory is on the same file system, so one rename can give it its name.
        hidden = path.with_name(f".{path.name}.unfinished")
        shutil.rmtree(hidden, ignore_errors=True)
        unfinished = hidden / path.name
        unfinished.mkdir(parents=True)
        try:
            yield unfinished
            os.rename(unfinished, path)
        except DatasetError as error:
            if error.path is None or not error.path.is_relative_to(unfinished):
                raise
            raise error.locate(path / error.path.relative_to(unfinished)) from error
        finally:
            shutil.rmtree(hidden, ignore_errors=True)
    except OSError as error:
        raise unwritable(path, error) from error


def remove(path: Path) -> None:
    """Remove a file, if it exists."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise DatasetError(f"cannot be removed: {error.strerror}", path=path) from error


def sync_directory(directory: Path) -> None:
    """Make the names in a directory survive a power cut."""
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_all(descriptor: int, data: bytes | bytearray) -> None:
    """Write all bytes; `os.write` may write only some of them at a time."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def read_text(path: Path, *, most_bytes: int) -> str:
    """Read a regular file as UTF-8 text."""
    try:
        with open(open_regular(path), "rb") as file:
            # One byte more than allowed shows that the file is too large, however large it is.
            data = file.read(most_bytes + 1)
        if len(data) > most_bytes:
            raise DatasetError(f"cannot be read: larger than {most_bytes} bytes", path=path)
        return data.decode("utf-8")
    except OSError as error:
        raise unreadable(path, error) from error
    except UnicodeDecodeError as error:
        raise DatasetError(f"cannot be read: no UTF-8 text: byte {error.start}", path=path) from error


def write_file(path: Path, data: bytes, *, mode: int = 0o666) -> None:
    """Write a whole file at once, in place of any file of that name; its mode holds from the first moment on."""
    with replacing(path, mode=mode) as descriptor:
        write_all(descriptor, data)
