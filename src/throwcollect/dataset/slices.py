"""Slices of a dataset: their directories while many tasks collect them, and how they are joined.

A slice is collected as a dataset of its own, in a directory that no other process uses, called an **attempt**. When it
is finished, its recordings, its table and its manifest go to the directory of the slice by one rename, which succeeds
for one attempt alone. So nothing has to be locked, and an attempt that seemed dead, or was started twice, does no harm,
as it would put the same bytes there::

    slices/3-of-8/                      a finished slice
    slices/3-of-8.attempt-<id>/         an attempt, unfinished; its logs are in it

An attempt begins with what earlier ones have recorded. It removes attempts that were stopped and shut down properly, so
that a task that is queued again and again does not fill the disk; attempts that ended in another way stay, as their
logs may explain it.

To join them, their recordings are moved into one directory, and the tables of the whole are written. Only the
statistics at the end of each recording are read. If joining is interrupted, it can be done again and gives the same
dataset: ``metadata.yaml``, which marks a finished dataset, is written last; then the slices are removed.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import ATTEMPT, MANIFEST, METADATA, PLAN, SHARD_SUFFIX, THROWS, shard_name
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.manifest import FileEntry, entry_of, read_manifest
from throwcollect.dataset.throws_table import read_throws
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import open_regular, unreadable, unwritable
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice
from throwcollect.progress_log import log_progress
from throwcollect.wording import command, format_count

SLICES = "slices"
"""Name of the directory of slices, inside the directory of a dataset."""

_UNFINISHED = f"{SHARD_SUFFIX}.part"
_STOPPED = "stopped"
_MOST_NAMED = 8
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


def make_attempt(directory: Path, slice: Slice) -> Path:
    """Make an empty directory for an attempt at a slice, unlike any other."""
    name = f"{slice_directory(directory, slice).name}{ATTEMPT}{socket.gethostname()}-{secrets.token_hex(4)}"
    path = directory / SLICES / name
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
    """Mark an attempt as shut down properly: no process writes to it any more."""
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
            os.rename(attempt / name, packed / name)
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


def _list(directory: Path) -> list[str]:
    try:
        return sorted(os.listdir(directory))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise unreadable(directory, error) from error


def join(directory: Path) -> None:
    """Make a finished dataset of its slices; one that is finished already stays as it is."""
    with hold_lock(directory, needed=False):
        if not (directory / METADATA).exists():
            _join(directory)
        shutil.rmtree(directory / SLICES, ignore_errors=True)


def _count_slices(directory: Path, finished: Collection[Slice]) -> int:
    """Find the number of slices that a dataset was cut into."""
    counts = sorted({each.count for each in finished})
    if not counts:
        hint = "throwcollect up --slice 0/8 --output DIR collects the first of eight"
        raise ConfigError(f"{directory}: holds no finished slices", hint=hint)
    if len(counts) > 1:
        raise ConfigError(
            f"{directory / SLICES}: holds slices of {' and of '.join(map(str, counts))}",
            expected="slices I/N with the same N",
            hint="remove the directories of the others",
        )
    return counts[0]


def _join(directory: Path) -> None:
    plan = Plan.read(directory / PLAN, read_config(directory))
    finished = find_finished(directory)
    slices = Slice.all_of(_count_slices(directory, finished))
    if missing := [each for each in slices if each not in finished]:
        named = ", ".join(map(str, missing[:_MOST_NAMED])) + (" and more" if missing[_MOST_NAMED:] else "")
        raise DatasetError(
            f"lacks {format_count(len(missing), 'slice')} of {len(slices)}: {named}",
            path=directory,
            hint=f"{command('up', '--slice', missing[0], '--output', directory)} collects the first of them",
        )
    with closing(DatasetWriter(directory, plan)) as writer:
        for each in log_progress(slices, len(slices), "slice", "joined"):
            _take(directory, plan.slice_of(each), each, writer)
        writer.finish()


def _take(directory: Path, part: Plan, slice: Slice, writer: DatasetWriter) -> None:
    """Move the recordings of a slice to the dataset, and hand them to its writer."""
    place = slice_directory(directory, slice)
    entries = {entry.path: entry for entry in read_manifest(place)}
    if entries.get(PLAN) != entry_of(PLAN, part.encode()):
        raise DatasetError(
            "was collected with another plan", path=place, hint=f"remove it, and collect slice {slice} again"
        )
    throws = read_throws(place, part)
    per_shard = part.config.record.trials_per_shard
    # A slice consists of whole shards, so each of these trials is the first of one.
    for first in part.trials.numbers[::per_shard]:
        number = first // per_shard
        name = shard_name(part.config.name, number)
        entry = entries.get(name)
        # A shard of which all trials were refused or lost has no file.
        recording = None if entry is None else (_move_recording(place / name, directory / name, entry), entry)
        writer.take_shard(number, recording, throws.slice(first - part.trials.first, per_shard))


def _move_recording(source: Path, target: Path, entry: FileEntry) -> FileSummary:
    """Move a recording, unless an earlier join has moved it, and read its statistics."""
    if source.exists():
        try:
            os.replace(source, target)
        except OSError as error:
            raise unwritable(target, error) from error
    return read_statistics(target, entry)


def read_statistics(target: Path, entry: FileEntry) -> FileSummary:
    """Read the statistics of a finished recording, which has the size that its manifest states."""
    try:
        with open(open_regular(target), "rb") as file:
            size = os.fstat(file.fileno()).st_size
            # Only the size is checked: hashing would mean to read all recordings of the dataset in one process.
            if size != entry.bytes:
                raise DatasetError(f"has {size} bytes", path=target, expected=f"{entry.bytes}, as in its manifest")
            summary = make_reader(file).get_summary()
    except OSError as error:
        raise unreadable(target, error) from error
    except (McapError, ValueError) as error:
        raise DatasetError(f"is damaged: {error}", path=target) from error
    if summary is None or summary.statistics is None:
        raise DatasetError("is damaged: it has no statistics of its contents", path=target)
    found = summary.statistics
    counts: Mapping[int, int] = dict(sorted(found.channel_message_counts.items()))
    return FileSummary(entry.path, found.message_start_time, found.message_end_time, counts)
