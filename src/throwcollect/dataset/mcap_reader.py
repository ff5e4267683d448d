"""Reads the records of one MCAP file of a dataset, and believes nothing that the file says without a check.

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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.dataset.mcap_file import EPISODE, MAGIC, RecordGroup, episode_run
from throwcollect.episode.channels import ROBOT_DESCRIPTION_ID
from throwcollect.episode.chunk import (
    CHUNK_HEADER_BYTES,
    CHUNK_MARK,
    CHUNK_MARK_OFFSET,
    MOST_RATIO,
    RECORD_PREFIX_BYTES,
    Chunk,
)
from throwcollect.episode.episode_message import Episode, header_from_json
from throwcollect.episode.message_table import MessageTable
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable
from throwcollect.sweep.digest import is_digest

_FACTS_MARK = len(EPISODE).to_bytes(4, "little") + EPISODE.encode()
"""How the contents of the Metadata record of an episode begin."""
_EFFORT = 64
"""Most bytes that are read in vain for each byte of the file; only a file that was made to be slow needs more."""

_RECORD_HEADER = struct.Struct("<BQ")


class McapRecord(NamedTuple):
    """One record: where it begins in the file [bytes], its kind, and its bytes, with opcode and length."""

    offset: int
    opcode: int
    data: bytes

    @property
    def end(self) -> int:
        """Where the next record begins [bytes]."""
        return self.offset + len(self.data)

    @property
    def kind(self) -> str:
        """Its kind in words."""
        # Before Python 3.12, to look for a number in the enumeration itself is an error.
        return Opcode(self.opcode).name.lower() if self.opcode in set(Opcode) else f"record 0x{self.opcode:02x}"

    def parse_metadata(self) -> records.Metadata:
        """Read the fields of a Metadata record."""
        try:
            read: records.Metadata = records.Metadata.read(ReadDataStream(io.BytesIO(self.data[_RECORD_HEADER.size :])))
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            raise DatasetError(f"{self.kind} record is not readable", place=f"byte {self.offset}") from error
        return read


@dataclass(frozen=True)
class StoredEpisode:
    """An episode as it lies in a file: its chunk, the bytes of its message indexes, and a Metadata record, `facts`.

    `stated_digest` is the digest that this record states; None if it states none.
    """

    episode: Episode
    chunk: McapRecord
    indexes: bytes
    facts: McapRecord
    stated_digest: str | None

    @property
    def offset(self) -> int:
        """Where it begins in the file [bytes]."""
        return self.chunk.offset

    @property
    def end(self) -> int:
        """Where it ends in the file [bytes]; the file may be cut there."""
        return self.facts.end

    @classmethod
    def of(cls, contents: McapContents, chunk: McapRecord, facts: McapRecord) -> StoredEpisode:
        """Read the episode of a chunk and of the Metadata record that ends it, whatever lies between the two."""
        stated = facts.parse_metadata() if facts.opcode == Opcode.METADATA else None
        if stated is None or stated.name != EPISODE:
            place = f"byte {facts.offset}"
            raise DatasetError(f"a {facts.kind} where the metadata of an episode should be", place=place)
        try:
            if not is_digest(sha256 := stated.metadata.get("records_sha256", "")):
                raise DatasetError(f"episode: SHA-256 {sha256[:80]!r}", expected="64 hexadecimal digits")
            parsed = replace(Chunk.parse(memoryview(chunk.data)), records_sha256=sha256)
            episode = Episode(header_from_json(stated.metadata.get("header", "")), parsed)
        except DatasetError as error:
            raise error.locate(place=f"byte {chunk.offset}") from error
        indexes = contents.slice(chunk.end, facts.offset)
        return cls(episode, chunk, indexes, facts, stated.metadata.get("digest"))

    @property
    def run(self) -> RecordGroup | None:
        """Its run of records without their bytes; None if it is not byte for byte what the writer makes of the episode.

        The message indexes or metadata of a whole episode without a run are damaged, so it has to be written anew.
        """
        run = episode_run(self.episode)
        same = run.data == self.chunk.data + self.indexes + self.facts.data
        return replace(run, data=b"", offset=self.offset) if same else None

    def check_whole(self) -> None:
        """Compare everything that is hashed with its hashes."""
        self.episode.chunk.check_records()
        if self.stated_digest != self.episode.digest:
            place, expected = f"byte {self.facts.offset}", self.episode.digest
            raise DatasetError("the digest is not that of the header", place=place, expected=expected)


class McapContents:
    """The bytes of a whole file, read record by record."""

    def __init__(self, data: mmap.mmap | bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def slice(self, start: int, end: int) -> bytes:
        """Return the bytes of the file from `start` to `end`, not included."""
        return self._data[start:end]

    def record(self, offset: int) -> McapRecord:
        """Read the record that begins at an offset."""
        header = self._data[offset : offset + _RECORD_HEADER.size]
        if offset < 0 or len(header) < _RECORD_HEADER.size:
            raise DatasetError("the file is cut off", place=f"byte {offset}")
        opcode, length = _RECORD_HEADER.unpack(header)
        end = offset + _RECORD_HEADER.size + length
        if end > len(self._data):
            raise DatasetError(f"a record of {length} bytes goes beyond the end of the file", place=f"byte {offset}")
        return McapRecord(offset, opcode, self._data[offset:end])

    def find(self, pattern: bytes, start: int) -> int:
        """Find some bytes from `start` on; -1 if they are nowhere."""
        return self._data.find(pattern, start)

    def next_chunk(self, start: int) -> int:
        """Find the first whole record from `start` on that looks like a chunk; -1 if none does.

        Records need not follow each other: chunks are found by the bytes that all their headers hold.
        """
        # The bytes of a header may occur by chance, so the length that they announce has to fit into the file, too.
        mark = self.find(CHUNK_MARK, start + CHUNK_MARK_OFFSET)
        while mark >= 0:
            offset = mark - CHUNK_MARK_OFFSET
            size = Chunk.read_announced_size(self._data[offset : offset + CHUNK_HEADER_BYTES])
            if 0 < size <= len(self._data) - offset:
                return offset
            mark = self.find(CHUNK_MARK, mark + 1)
        return -1

    def read_robot_description(self) -> str:
        """Read the URDF text of the robot, which is among the latched messages that every file begins with."""
        try:
            table = MessageTable(self.chunk(self.next_chunk(0)).decompress(), 1)
            message = table.messages(ROBOT_DESCRIPTION_ID)[0].tobytes()
            text: str = deserialize(message, get_message("std_msgs/msg/String")).data
        except (DatasetError, KeyError, ValueError) as error:
            raise DatasetError(f"/robot_description is not readable: {error}") from error
        return text

    def chunk(self, offset: int) -> Chunk:
        """Read the chunk that begins at an offset, alone."""
        size = Chunk.read_announced_size(self.slice(offset, offset + CHUNK_HEADER_BYTES))
        return Chunk.parse(self.slice(offset, offset + size))

    def episode(self, chunk: McapRecord) -> StoredEpisode:
        """Read the episode whose chunk a record is."""
        if chunk.opcode != Opcode.CHUNK:
            raise DatasetError(f"a {chunk.kind} where the chunk of an episode should be", place=f"byte {chunk.offset}")
        record = self.record(chunk.end)
        while record.opcode == Opcode.MESSAGE_INDEX:
            record = self.record(record.end)
        return StoredEpisode.of(self, chunk, record)


def _measure(descriptor: int) -> int:
    """Find how much of a file is to be read [bytes]: holes, which give zeros, only up to the size of the data."""
    size, written, end = os.fstat(descriptor).st_size, 0, 0
    try:
        while end < size:
            start = os.lseek(descriptor, end, os.SEEK_DATA)
            end = os.lseek(descriptor, start, os.SEEK_HOLE)
            written += end - start
    except OSError as error:
        # No data follow. With any other error, the file system does not tell holes and data apart.
        if error.errno != errno.ENXIO:
            return size
    # One byte more shows that data and file do not end together.
    return min(size, 2 * written + 1)


@contextmanager
def map_file(path: Path) -> Iterator[McapContents]:
    """Map a file into memory while the block lasts, whatever it contains; one of holes only up to twice its data."""
    try:
        descriptor = open_regular(path)
        try:
            size = _measure(descriptor)
            # An empty file cannot be mapped.
            data = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ) if size else b""
        finally:
            # The mapping keeps the file open by itself.
            os.close(descriptor)
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        yield McapContents(data)
    finally:
        if isinstance(data, mmap.mmap):
            data.close()


@contextmanager
def open_mcap(path: Path) -> Iterator[McapContents]:
    """Map an MCAP file into memory while the block lasts."""
    with map_file(path) as contents:
        if contents.slice(0, len(MAGIC)) != MAGIC:
            raise DatasetError("not an MCAP file", path=path)
        yield contents


class EpisodePlace(NamedTuple):
    """The place of an episode: its file, and the offset of its chunk there [bytes].

    `start_ns`, the time of its first sample [ns], says which trial it is of; `samples` is their number.
    """

    path: Path
    offset: int
    start_ns: int
    samples: int

    def read(self) -> Episode:
        """Read the episode from its file."""
        with open_mcap(self.path) as contents:
            try:
                episode = contents.episode(contents.record(self.offset)).episode
                self.check_start(episode.chunk)
            except DatasetError as error:
                raise error.locate(self.path, f"byte {self.offset}") from error
        return episode

    def check_start(self, chunk: Chunk) -> None:
        """Check that the chunk at this place begins when the episode does."""
        if chunk.start_ns != self.start_ns:
            raise DatasetError(f"starts at {chunk.start_ns} ns", expected=f"{self.start_ns} ns")


def scan(contents: McapContents) -> Iterator[StoredEpisode]:
    """Find all whole episodes of a file, in the order in which they lie there; one episode at a time is in memory.

    An episode is whole if its chunk has its CRC and the hash that is written beside it, and header and hash have the
    digest. The search for the next one goes on behind it, and otherwise within its records, as their lengths may be
    what is wrong. The episodes may be of another dataset.

    Args:
        contents: The contents of an MCAP file or of its beginning, finished or not.
    """
    effort = _EFFORT * len(contents)
    # The place of the next metadata of an episode: looked up once for all chunks before it; -1 if there is none.
    facts = 0
    offset = contents.next_chunk(0)
    while offset >= 0 and effort > 0:
        record = contents.record(offset)
        if 0 <= facts < record.end + RECORD_PREFIX_BYTES:
            facts = contents.find(_FACTS_MARK, record.end + RECORD_PREFIX_BYTES)
        found = _find_whole(contents, record, facts - RECORD_PREFIX_BYTES)
        if found is not None:
            yield found
            offset = contents.next_chunk(found.end)
            continue
        # The effort counts the bytes that were read, and those that were decompressed from them at most.
        effort -= len(record.data) + min(Chunk.parse(record.data).uncompressed_size, MOST_RATIO * len(record.data))
        offset = contents.next_chunk(offset + 1)


def scan_file(path: Path) -> Iterator[StoredEpisode]:
    """Find all whole episodes of an MCAP file or of its beginning, in order; a missing file has none."""
    try:
        with map_file(path) as contents:
            yield from scan(contents)
    except DatasetError as error:
        # Only opening tells whether it is there: another process may remove it after a look for it.
        if not isinstance(error.__cause__, FileNotFoundError):
            raise


def _find_whole(contents: McapContents, chunk: McapRecord, facts: int) -> StoredEpisode | None:
    """Read the whole episode whose chunk a record is; None if the record begins no whole episode.

    `facts` is where the next metadata of an episode begin [bytes]; negative if there are none. The message indexes
    between the chunk and these metadata may be damaged.
    """
    try:
        stored = StoredEpisode.of(contents, chunk, contents.record(facts))
        stored.check_whole()
    except DatasetError:
        return None
    return stored
