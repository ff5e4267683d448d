"""Where the slices of a dataset lie while it is collected by many, and how the files of one appear all at once.

A slice is collected as a dataset of its own, in a directory that nobody else uses: that of an **attempt**. When it is
finished, its recordings, its table and its manifest go to the directory of the slice by one rename, which succeeds for
one attempt alone. So nothing has to be locked, and an attempt that was believed dead, or was started twice, can change
nothing: what it would put there is the same, byte for byte::

    slices/3-of-8/                      a finished slice
    slices/3-of-8.attempt-<id>/         an attempt, unfinished; its logs are in it

An attempt begins with what earlier ones have recorded. Those that were stopped in order are removed then, so that a
task that is queued again and again does not fill the disk; those that ended otherwise stay for their logs.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from throwcollect.dataset.directory import ATTEMPT, MANIFEST, SHARD_SUFFIX, THROWS
from throwcollect.files import unreadable, unwritable
from throwcollect.sweep.slice import Slice

SLICES = "slices"
"""Name of the directory of slices in that of a dataset."""

_UNFINISHED = f"{SHARD_SUFFIX}.part"
_STOPPED = "stopped"
_NAME = re.compile(r"(\d+)-of-(\d+)", re.ASCII)


def slice_directory(directory: Path, slice: Slice) -> Path:
    """Directory of a finished slice.

    Args:
        directory: Directory of the dataset.
        slice: Which one.
    """
    return directory / SLICES / f"{slice.index}-of-{slice.count}"


def find_finished(directory: Path) -> frozenset[Slice]:
    """The slices of a dataset that are finished.

    Raises:
        DatasetError: If the directory of slices cannot be read.
    """
    names = _list(directory / SLICES)
    return frozenset(Slice(int(match[1]), int(match[2])) for name in names if (match := _NAME.fullmatch(name)))


def find_attempts(directory: Path, slice: Slice) -> list[Path]:
    """Directories of unfinished attempts at a slice, by name.

    Raises:
        DatasetError: If the directory of slices cannot be read.
    """
    start = f"{slice_directory(directory, slice).name}{ATTEMPT}"
    return sorted(directory / SLICES / name for name in _list(directory / SLICES) if name.startswith(start))


def make_attempt(directory: Path, slice: Slice, *, scratch: Path | None = None) -> Path:
    """Make a directory for an attempt at a slice, empty and unlike any other.

    Args:
        directory: Directory of the dataset.
        slice: Which one.
        scratch: Where it is made; None for the place beside all slices.

    Raises:
        DatasetError: If it cannot be made.
    """
    name = f"{slice_directory(directory, slice).name}{ATTEMPT}{socket.gethostname()}-{secrets.token_hex(4)}"
    path = (scratch or directory / SLICES) / name
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise unwritable(path, error) from error
    return path


def take_recordings(earlier: Sequence[Path], attempt: Path) -> None:
    """Give an attempt what earlier ones have recorded: of each shard the copy with the most in it.

    Copies are made, as what is unfinished will be written to, and some of the earlier ones may go on writing: whole
    episodes are found later.

    Args:
        earlier: Directories of earlier attempts.
        attempt: Directory of the new one.

    Raises:
        DatasetError: If something cannot be copied.
    """
    most: dict[str, Path] = {}
    for path in sorted((each / name for each in earlier for name in _list(each)), key=_how_much):
        if path.name.endswith((SHARD_SUFFIX, _UNFINISHED)):
            most[path.name.removesuffix(".part")] = path
    for path in most.values():
        target = attempt / path.name
        try:
            shutil.copyfile(path, target, follow_symlinks=False)
        except FileNotFoundError:
            continue  # the earlier attempt has just renamed it
        except OSError as error:
            raise unwritable(target, error) from error


def _how_much(path: Path) -> tuple[bool, int]:
    """Orders the recordings of one shard: finished ones are last, and among others the longest."""
    try:
        return not path.name.endswith(_UNFINISHED), path.lstat().st_size
    except FileNotFoundError:
        return False, 0


def mark_stopped(attempt: Path) -> None:
    """Say that an attempt was stopped in order, so that nobody writes to it any more.

    Args:
        attempt: Its directory.
    """
    with suppress(OSError):  # it is kept beside the next one then
        (attempt / _STOPPED).touch()


def remove_stopped(attempts: Sequence[Path]) -> None:
    """Remove those of some attempts that were stopped in order, when another one has what they recorded.

    Args:
        attempts: Their directories.
    """
    for each in attempts:
        if (each / _STOPPED).exists():
            shutil.rmtree(each, ignore_errors=True)


def publish(attempt: Path, directory: Path, slice: Slice) -> bool:
    """Put a finished attempt into the place of its slice, and remove what remains of it.

    Args:
        attempt: Directory of the attempt, a finished dataset.
        directory: Directory of the whole dataset.
        slice: Which slice it is.

    Returns:
        Whether it was the first one; if not, it is removed.

    Raises:
        DatasetError: If files cannot be moved; the attempt stays then.
    """
    place = slice_directory(directory, slice)
    # Should this end half way, it counts as an attempt that the next one begins with.
    packed = directory / SLICES / f"{attempt.name}-packed"
    try:
        packed.mkdir(parents=True, exist_ok=True)
        for name in _names_to_publish(attempt):
            _move(attempt / name, packed / name)
        try:
            packed.rename(place)
            first = True
        except OSError:
            if not place.is_dir():
                raise
            shutil.rmtree(packed, ignore_errors=True)
            first = False
    except OSError as error:
        raise unwritable(packed, error) from error
    shutil.rmtree(attempt, ignore_errors=True)
    return first


def _names_to_publish(attempt: Path) -> Iterator[str]:
    yield from (name for name in _list(attempt) if name.endswith(SHARD_SUFFIX))
    yield from (THROWS, MANIFEST)


def _move(source: Path, target: Path) -> None:
    """Rename a file, or copy it where it lies on another file system; then it is on disk before this returns."""
    with suppress(OSError):
        os.rename(source, target)
        return
    shutil.copyfile(source, target, follow_symlinks=False)
    with target.open("rb") as file:
        os.fsync(file.fileno())


def _list(directory: Path) -> list[str]:
    try:
        return sorted(os.listdir(directory))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise unreadable(directory, error) from error
