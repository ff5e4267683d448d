"""Joins the slices of a dataset: moves their recordings beside each other, and writes the tables of the whole.

Only the statistics at the end of each recording are read. If joining is interrupted, it can be done again and gives the
same dataset: ``metadata.yaml``, which marks a finished dataset, is written last, and the slices are removed after that.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Mapping
from contextlib import closing
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import METADATA, PLAN, shard_name
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.manifest import FileEntry, entry_of, read_manifest
from throwcollect.dataset.slice_directory import SLICES, find_finished, slice_directory
from throwcollect.dataset.throws_table import read_throws
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import open_regular, unreadable, unwritable
from throwcollect.progress_log import log_progress
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.slice import Slice
from throwcollect.wording import command, format_count

_MOST_NAMED = 8


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
        recording = None if entry is None else (_move(place / name, directory / name, entry), entry)
        writer.take_shard(number, recording, throws.slice(first - part.trials.first, per_shard))


def _move(source: Path, target: Path, entry: FileEntry) -> FileSummary:
    """Move a recording, unless an earlier join has moved it, and read its statistics."""
    if source.exists():
        try:
            os.replace(source, target)
        except OSError as error:
            raise unwritable(target, error) from error
    try:
        with open(open_regular(target), "rb") as file:
            size = os.fstat(file.fileno()).st_size
            # Only the size is checked: hashing would mean to read all recordings of the dataset in one process.
            if size != entry.bytes:
                raise DatasetError(f"has {size} bytes", path=target, expected=f"{entry.bytes}, as its slice says")
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
