"""Directories of the slices of a dataset while many tasks collect it, and how the files of a slice appear all at once.

A slice is collected as a dataset of its own, in a directory that nobody else uses, called an **attempt**. When it is
finished, its recordings, its table and its manifest go to the directory of the slice by one rename, which succeeds for
one attempt alone. So nothing has to be locked, and an attempt that seemed dead, or was started twice, does no harm, as
it would put the same bytes there::

    slices/3-of-8/                      a finished slice
    slices/3-of-8.attempt-<id>/         an attempt, unfinished; its logs are in it

An attempt begins with what earlier ones have recorded. It removes attempts that were stopped and shut down properly, so
that a task that is queued again and again does not fill the disk; attempts that ended in another way stay, as their
logs may say why.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from throwcollect.dataset.directory import ATTEMPT, MANIFEST, SHARD_SUFFIX, THROWS
from throwcollect.files import unreadable, unwritable
from throwcollect.sweep.slice import Slice

SLICES = "slices"
"""Name of the directory of slices, inside the directory of a dataset."""

_UNFINISHED = f"{SHARD_SUFFIX}.part"
_STOPPED = "stopped"
_NAME = re.compile(r"(\d+)-of-(\d+)", re.ASCII)


def slice_directory(directory: Path, slice: Slice) -> Path:
    """Make the path of the directory of a finished slice of a dataset."""
    return directory / SLICES / f"{slice.index}-of-{slice.count}"


def find_finished(directory: Path) -> frozenset[Slice]:
    """Find the finished slices of a dataset."""
    names = _list(directory / SLICES)
    return frozenset(Slice(int(match[1]), int(match[2])) for name in names if (match := _NAME.fullmatch(name)))


def find_attempts(directory: Path, slice: Slice) -> list[Path]:
    """Find the directories of unfinished attempts at a slice, by name."""
    start = f"{slice_directory(directory, slice).name}{ATTEMPT}"
    return sorted(directory / SLICES / name for name in _list(directory / SLICES) if name.startswith(start))


def make_attempt(directory: Path, slice: Slice, *, scratch: Path | None = None) -> Path:
    """Make an empty directory for an attempt at a slice, in `scratch` or else beside all slices, unlike any other."""
    name = f"{slice_directory(directory, slice).name}{ATTEMPT}{socket.gethostname()}-{secrets.token_hex(4)}"
    path = (scratch or directory / SLICES) / name
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise unwritable(path, error) from error
    return path


def take_recordings(earlier: Sequence[Path], attempt: Path) -> None:
    """Copy what earlier attempts have recorded into the directory of a new one: the longest copy of each shard.

    A finished file counts as longer than an unfinished one. Unfinished files are not moved, as an earlier attempt may
    still write to them; the new one looks for whole episodes in its copy.
    """
    most: dict[str, Path] = {}
    # The longest copy comes last, and takes the place of the shorter ones.
    for path in sorted((each / name for each in earlier for name in _list(each)), key=_rank_copy):
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


def _rank_copy(path: Path) -> tuple[bool, int]:
    """Make the key that sorts the recordings of one shard: unfinished ones by length, then finished ones."""
    try:
        return not path.name.endswith(_UNFINISHED), path.lstat().st_size
    except FileNotFoundError:
        return False, 0


def mark_stopped(attempt: Path) -> None:
    """Mark an attempt as shut down properly: nobody writes to it any more."""
    with suppress(OSError):  # without the mark, it only stays on disk
        (attempt / _STOPPED).touch()


def remove_stopped(attempts: Sequence[Path]) -> None:
    """Remove those of some attempts that were shut down properly, once another one has their recordings."""
    for attempt in attempts:
        if (attempt / _STOPPED).exists():
            shutil.rmtree(attempt, ignore_errors=True)


def publish(attempt: Path, directory: Path, slice: Slice) -> bool:
    """Put a finished attempt into the place of its slice in the directory of a dataset, and remove what remains of it.

    Returns:
        Whether it was the first one; if not, it is removed.
    """
    place = slice_directory(directory, slice)
    # If this process is killed in between, the next attempt takes the recordings from here, as from any other one.
    packed = directory / SLICES / f"{attempt.name}-packed"
    try:
        packed.mkdir(parents=True, exist_ok=True)
        shards = [name for name in _list(attempt) if name.endswith(SHARD_SUFFIX)]
        for name in (*shards, THROWS, MANIFEST):
            _move(attempt / name, packed / name)
        try:
            # A rename replaces no directory with files in it, so the first attempt wins.
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


def _move(source: Path, target: Path) -> None:
    """Rename a file, or copy it where it lies on another file system; then it is on disk before this returns."""
    # A rename to another file system fails, and then the file is copied below.
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
