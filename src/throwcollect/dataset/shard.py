"""One shard while it is filled: episodes in order of arrival, and at the end the same in order of trials.

While a shard is filled it is called ``<name>_00000.mcap.part``: an MCAP file that lacks only its summary and footer, in
which every episode is one run of records. When its last trial is in, the runs are copied in order of trials into the
file ``<name>_00000.mcap``, and the other vanishes.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import path_of_part
from throwcollect.dataset.manifest import FileEntry
from throwcollect.dataset.mcap_file import McapFile, RecordGroup, episode_run
from throwcollect.dataset.mcap_reader import McapContents
from throwcollect.dataset.throws_table import Row
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, remove, replacing, unwritable, write_all

Recording = tuple[FileSummary, FileEntry]
"""What bag metadata and manifest state of an MCAP file."""


@dataclass(frozen=True)
class FinishedShard:
    """A shard in trial order under its final name.

    Attributes:
        recording: Its file; None if no trial has an episode, and so there is none.
        offsets: Where the chunk of each trial's episode begins [bytes].
    """

    recording: Recording | None
    offsets: dict[int, int]


def write_runs(
    write: Callable[[bytes], None], channels: Channels, runs: Iterable[tuple[int, RecordGroup]], *, name: str
) -> FinishedShard:
    """Write the finished file of some episodes, at least one, each with its trial; it depends on nothing but them."""
    sha256, file, offsets = hashlib.sha256(), None, {}

    def put(data: bytes) -> None:
        write(data)
        sha256.update(data)

    for trial, run in runs:
        file = file or McapFile(put, channels, start_ns=run.start_ns)
        offsets[trial] = file.size
        file.append(run)
    if file is None:
        raise ValueError(name)
    summary = file.finish(name)
    return FinishedShard((summary, FileEntry(name, file.size, sha256.hexdigest())), offsets)


def _read_runs(runs: Mapping[int, RecordGroup], read: Callable[[int, int], bytes]) -> Iterator[tuple[int, RecordGroup]]:
    """Read runs from the file that they lie in, in order of trials; `read` takes an offset and a length."""
    return ((trial, replace(run, data=read(run.offset, run.length))) for trial, run in sorted(runs.items()))


def rewrite(
    contents: McapContents, channels: Channels, runs: Mapping[int, RecordGroup], *, name: str
) -> tuple[FinishedShard, int | None]:
    """Write the finished file of the episodes of a file, and compare the two.

    Returns:
        What is written, and the offset of the first records in which the file differs from it; None if it does not.
    """
    size, difference = 0, None

    def compare(data: bytes) -> None:
        nonlocal size, difference
        if difference is None and contents.slice(size, size + len(data)) != data:
            difference = size
        size += len(data)

    def read(offset: int, length: int) -> bytes:
        return contents.slice(offset, offset + length)

    finished = write_runs(compare, channels, _read_runs(runs, read), name=name)
    return finished, size if difference is None and size != len(contents) else difference


class OpenShard:
    """A shard that still waits for episodes.

    Attributes:
        missing: Trials that neither have an episode nor are known to be lost.
        rows: Rows of the table of throws of its trials that have ended, by trial.
        path: Final path of the shard.
        part: Path of the shard while it is filled.
    """

    def __init__(self, path: Path, channels: Channels) -> None:
        self.missing: set[int] = set()
        self.rows: dict[int, Row] = {}
        self.path = path
        self.part = path_of_part(path)
        self._channels = channels
        self._descriptor: int | None = None
        self._size = 0
        self._synced = True
        self._runs: dict[int, RecordGroup] = {}

    def adopt(self, runs: Mapping[int, RecordGroup]) -> None:
        """Go on with the unfinished file of a shard, which has these runs; what follows the last of them is cut off."""
        size = max(run.end for run in runs.values())
        try:
            self._descriptor = open_regular(self.part, os.O_RDWR)
            self._cut(self._descriptor, size)
        except OSError as error:
            raise unwritable(self.part, error) from error
        self._size = size
        self._runs |= runs
        self.missing.difference_update(runs)

    def append(self, episode: Episode) -> None:
        """Write an episode; when it fails, the file is as it was before."""
        run = episode_run(episode)
        start = self._size
        try:
            if self._descriptor is None:
                self._descriptor = open_regular(self.part, os.O_RDWR | os.O_CREAT | os.O_EXCL)
            if not start:
                # Making an `McapFile` writes the beginning of the file; an unfinished file needs it for nothing else.
                McapFile(self._write, self._channels, start_ns=episode.chunk.start_ns)
            offset = self._size
            self._write(run.data)
        except OSError as error:
            if self._descriptor is not None:
                with suppress(OSError):
                    self._cut(self._descriptor, start)
            self._size = start
            raise unwritable(self.part, error) from error
        # The bytes are dropped, as the file has them; otherwise, whole shards would be in memory.
        self._runs[episode.header.trial] = replace(run, data=b"", offset=offset)
        self.missing.discard(episode.header.trial)

    def finish(self) -> FinishedShard:
        """Write the shard in trial order and remove what it was copied from."""
        finished = FinishedShard(None, {})
        if self._runs:
            # The final file is on the disk before the unfinished one is removed, so at any moment one has all episodes.
            with replacing(self.path) as descriptor:
                runs = _read_runs(self._runs, self._read)
                finished = write_runs(partial(write_all, descriptor), self._channels, runs, name=self.path.name)
        if self._descriptor is not None:
            self.close()
            remove(self.part)
        return finished

    def sync(self) -> None:
        """Make the appended episodes survive a power cut."""
        if self._descriptor is None or self._synced:
            return
        try:
            os.fdatasync(self._descriptor)
        except OSError as error:
            raise unwritable(self.part, error) from error
        self._synced = True

    def close(self) -> None:
        """Close the file, which stays on disk."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _read(self, offset: int, length: int) -> bytes:
        if self._descriptor is None:
            raise ValueError("the shard is closed")
        data = os.pread(self._descriptor, length, offset)
        if len(data) != length:
            raise DatasetError("was cut off by another process while it was written", path=self.part)
        return data

    def _write(self, data: bytes) -> None:
        if self._descriptor is None:
            raise ValueError("the shard is closed")
        write_all(self._descriptor, data)
        self._size += len(data)
        self._synced = False

    @staticmethod
    def _cut(descriptor: int, size: int) -> None:
        os.ftruncate(descriptor, size)
        os.lseek(descriptor, size, os.SEEK_SET)
