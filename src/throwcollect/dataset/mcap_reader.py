"""Reads the records of one MCAP file of a dataset, and uses nothing from the file without a check.

Finding the episodes of a damaged file relies neither on the order of records nor on their lengths: chunks are found by
the bytes that every header of theirs holds, wherever they lie. So damage costs the damaged episodes, and never those
behind them.
"""

from __future__ import annotations

import errno
import io
import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.dataset.mcap_file import RecordGroup, episode_run
from throwcollect.episode.channels import ROBOT_DESCRIPTION_ID
from throwcollect.episode.chunk import CHUNK_HEADER_BYTES, CHUNK_MARK, CHUNK_MARK_OFFSET, RECORD_PREFIX_BYTES, Chunk
from throwcollect.episode.episode_message import Episode, header_from_json
from throwcollect.episode.message_table import MessageTable, check_frames
from throwcollect.episode.topics import Rows
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable
from throwcollect.plan.digest import is_digest

_RECORD_PREFIX = struct.Struct("<BQ")
_EFFORT = 64
"""Most bytes that are read in vain for each byte of the file; only a file that was made to be slow needs more."""


class McapRecord(NamedTuple):
    """One record: its kind, and where it begins and ends in the file [bytes]."""

    opcode: int
    offset: int
    end: int


class WholeEpisode(NamedTuple):
    """An episode that lies in a file byte for byte as the writer writes it, and its records without their bytes."""

    episode: Episode
    run: RecordGroup


class McapContents:
    """The bytes of a whole file, read record by record.

    Attributes:
        effort: How much was read and decompressed so far [bytes]; what was read again counts again.
    """

    def __init__(self, data: mmap.mmap | bytes) -> None:
        self._data = data
        self.effort = 0

    def __len__(self) -> int:
        return len(self._data)

    def slice(self, start: int, end: int) -> bytes:
        """Return the bytes of the file from `start` to `end`, not included."""
        self.effort += end - start
        return self._data[start:end]

    def record(self, offset: int) -> McapRecord:
        """Find the end of the record that begins at an offset."""
        prefix = self.slice(offset, offset + RECORD_PREFIX_BYTES)
        if len(prefix) < RECORD_PREFIX_BYTES:
            raise DatasetError("the file is cut off", place=f"byte {offset}")
        opcode, length = _RECORD_PREFIX.unpack(prefix)
        end = offset + RECORD_PREFIX_BYTES + length
        if end > len(self._data):
            raise DatasetError(f"a record of {length} bytes goes beyond the end of the file", place=f"byte {offset}")
        return McapRecord(opcode, offset, end)

    def next_chunk(self, start: int) -> int:
        """Find the first whole record from `start` on that looks like a chunk; -1 if none does.

        Records need not follow each other: chunks are found by the bytes that all their headers hold.
        """
        # The bytes of a header may occur by chance, so the length that they announce has to fit into the file, too.
        mark = self._data.find(CHUNK_MARK, start + CHUNK_MARK_OFFSET)
        while mark >= 0:
            offset = mark - CHUNK_MARK_OFFSET
            size = Chunk.read_announced_size(self._data[offset : offset + CHUNK_HEADER_BYTES])
            if 0 < size <= len(self._data) - offset:
                return offset
            mark = self._data.find(CHUNK_MARK, mark + 1)
        return -1

    def read_robot_description(self) -> str:
        """Read the URDF of the robot, which is among the latched messages that every file begins with."""
        try:
            table = MessageTable(self.chunk(self.next_chunk(0)).decompress(), 1)
            message = table.messages(ROBOT_DESCRIPTION_ID)[0].tobytes()
            text: str = deserialize(message, get_message("std_msgs/msg/String")).data
        except (DatasetError, KeyError, ValueError) as error:
            raise DatasetError(f"/robot_description is not readable: {error}") from error
        return text

    def chunk(self, offset: int) -> Chunk:
        """Read the chunk that begins at an offset, alone."""
        size = Chunk.read_announced_size(self._data[offset : offset + CHUNK_HEADER_BYTES])
        return Chunk.parse(memoryview(self.slice(offset, offset + size)))

    def episode(self, offset: int, *, sensors: bool = False) -> tuple[Episode, int]:
        """Read the episode whose chunk begins at an offset; returns it, and where its records end.

        The chunks of its sensors are read if they are asked for.
        """
        try:
            chunk = self.chunk(offset)
            begin = facts = self.record(offset + chunk.record_size)
            while facts.opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK):
                if begin.opcode == Opcode.MESSAGE_INDEX and facts.opcode == Opcode.CHUNK:
                    begin = facts
                facts = self.record(facts.end)
            data = self.slice(facts.offset + RECORD_PREFIX_BYTES, facts.end)
            stated = records.Metadata.read(ReadDataStream(io.BytesIO(data))).metadata
            header, sha256 = header_from_json(stated["header"]), stated["records_sha256"]
            hashes = stated.get("sensors_sha256", "").split()
            if facts.opcode != Opcode.METADATA or not all(map(is_digest, (sha256, *hashes))):
                raise ValueError(sha256)
            seen: list[Chunk] = []
            if sensors and hashes:
                seen = Chunk.parse_run(memoryview(self.slice(begin.offset, facts.offset)), hashes)
        except (EndOfFile, struct.error, ValueError, KeyError) as error:
            raise DatasetError("the metadata of the episode are not readable", place=f"byte {offset}") from error
        except DatasetError as error:
            raise error.locate(place=f"byte {offset}") from error
        return Episode(header, replace(chunk, records_sha256=sha256), sensors=tuple(seen)), facts.end

    def whole_episode(self, offset: int) -> WholeEpisode:
        """Read the episode whose chunk begins at an offset, and compare all its bytes with what the writer writes."""
        episode, end = self.episode(offset, sensors=True)
        episode.chunk.check_size()
        self.effort += episode.chunk.uncompressed_size
        episode.chunk.check_records()
        for chunk in episode.sensors:
            check_frames(chunk)
        run = episode_run(episode)
        if run.data != self._data[offset:end]:
            raise DatasetError("its message indexes or metadata do not fit its chunk", place=f"byte {offset}")
        return WholeEpisode(episode, replace(run, data=b"", offset=offset))


def _measure(descriptor: int) -> int:
    """Find how much of a file is to be read [bytes]: holes, which give zeros, only up to the size of the data."""
    size, written, end = os.fstat(descriptor).st_size, 0, 0
    try:
        while end < size:
            start = os.lseek(descriptor, end, os.SEEK_DATA)
            end = os.lseek(descriptor, start, os.SEEK_HOLE)
            written += end - start
    except OSError as error:
        # No data follow. With any other error, the file system does not know where its holes are.
        if error.errno != errno.ENXIO:
            return size
    # One byte more shows that data and file do not end together.
    return min(size, 2 * written + 1)


@contextmanager
def open_mcap(path: Path) -> Iterator[McapContents]:
    """Map a file into memory while the block lasts, whatever it contains; one of holes only up to twice its data."""
    try:
        descriptor = open_regular(path)
        try:
            size = _measure(descriptor)
            # An empty file cannot be mapped.
            data = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ) if size else b""
        finally:
            # The mapping keeps the file open.
            os.close(descriptor)
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        yield McapContents(data)
    finally:
        if isinstance(data, mmap.mmap):
            data.close()


class EpisodePlace(NamedTuple):
    """The place of an episode: its file, and the offset of its chunk there [bytes].

    `start_ns`, the time of its first sample [ns], identifies its trial; `samples` is their number.
    """

    path: Path
    offset: int
    start_ns: int
    samples: int

    def read(self, *, sensors: bool = False) -> Episode:
        """Read the episode from its file, with what its sensors saw if that is asked for."""
        with open_mcap(self.path) as contents:
            try:
                episode, _ = contents.episode(self.offset, sensors=sensors)
                self._check_start(episode.chunk)
            except DatasetError as error:
                raise error.locate(self.path, f"byte {self.offset}") from error
        return episode

    def read_rows(self, contents: McapContents, joints: tuple[str, ...]) -> Rows:
        """View the samples alone, which have these joints, given the contents of the file; see `MessageTable.rows`."""
        chunk = contents.chunk(self.offset)
        self._check_start(chunk)
        return MessageTable(chunk.decompress(), self.samples).rows(joints)

    def _check_start(self, chunk: Chunk) -> None:
        if chunk.start_ns != self.start_ns:
            raise DatasetError(f"starts at {chunk.start_ns} ns", expected=f"{self.start_ns} ns")


def scan(contents: McapContents) -> Iterator[WholeEpisode]:
    """Find all whole episodes of a file, in the order in which they lie there; one episode at a time is in memory.

    The search for the next one goes on behind it, and otherwise within its records, as their lengths may be what is
    wrong. The episodes may be of another dataset.

    Args:
        contents: The contents of an MCAP file or of its beginning, finished or not.
    """
    effort = _EFFORT * len(contents)
    offset = contents.next_chunk(0)
    while offset >= 0 and effort > 0:
        before = contents.effort
        try:
            found = contents.whole_episode(offset)
        except DatasetError:
            effort -= contents.effort - before
            offset = contents.next_chunk(offset + 1)
            continue
        yield found
        offset = contents.next_chunk(found.run.end)


def scan_file(path: Path) -> Iterator[WholeEpisode]:
    """Find all whole episodes of an MCAP file or of its beginning, in order; a missing file has none."""
    try:
        with open_mcap(path) as contents:
            yield from scan(contents)
    except DatasetError as error:
        # Only opening shows whether it is there: another process may remove it after a look for it.
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
