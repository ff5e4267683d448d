"""Reads the records of one MCAP file of a dataset, and believes nothing that the file says without a check."""

from __future__ import annotations

import errno
import io
import mmap
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.dataset.mcap_file import EPISODE, MAGIC, SENSORS_SHA256, RecordGroup, episode_run
from throwcollect.episode.channels import ROBOT_DESCRIPTION_ID
from throwcollect.episode.chunk import CHUNK_HEADER_BYTES, CHUNK_MARK, CHUNK_MARK_OFFSET, Chunk
from throwcollect.episode.episode_message import Episode, make_episode
from throwcollect.episode.message_table import MessageTable
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable

_RECORD_HEADER = struct.Struct("<BQ")
MOST_CHUNKS = 64
"""Most chunks that an episode may have, so that a file of nothing but chunks is not read again and again."""
_R = TypeVar("_R", covariant=True)


class _Kind(Protocol[_R]):
    """Class of an MCAP record that can be read without its length."""

    def read(self, stream: ReadDataStream) -> _R: ...


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

    def parse(self, kind: _Kind[_R]) -> _R:
        """Read its fields; `kind` is its class, which cannot be Message, as that has no length of its own."""
        try:
            return kind.read(ReadDataStream(io.BytesIO(self.data[_RECORD_HEADER.size :])))
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            raise DatasetError(f"{self.kind} record is not readable", place=f"byte {self.offset}") from error


@dataclass(frozen=True)
class StoredChunk:
    """A chunk of an episode as it lies in a file: its record, and those of its message indexes by channel."""

    record: McapRecord
    indexes: Mapping[int, McapRecord]


@dataclass(frozen=True)
class StoredEpisode:
    """An episode's run of records as it lies in a file: its chunks, the state chunk first, and a Metadata record.

    `stated_digest` is the digest that this record, `facts`, states; None if it states none.
    """

    episode: Episode
    chunks: tuple[StoredChunk, ...]
    facts: McapRecord
    stated_digest: str | None

    @property
    def offset(self) -> int:
        """Where it begins in the file [bytes]."""
        return self.chunks[0].record.offset

    @property
    def end(self) -> int:
        """Where it ends in the file [bytes]; the file may be cut there."""
        return self.facts.end

    @classmethod
    def of(cls, chunks: Sequence[StoredChunk], facts: McapRecord, stated: Mapping[str, str]) -> StoredEpisode:
        """Make the episode of some chunks and the Metadata record `facts` behind them, whose contents are `stated`."""
        hashes = [stated.get("records_sha256", ""), *stated.get(SENSORS_SHA256, "").split()]
        parsed = [Chunk.parse(memoryview(each.record.data)) for each in chunks]
        episode = make_episode(stated.get("header", ""), hashes, parsed)
        return cls(episode, tuple(chunks), facts, stated.get("digest"))

    @cached_property
    def intact_run(self) -> RecordGroup:
        """Its records as the writer makes them for the episode, which may differ from those in the file."""
        return episode_run(self.episode)

    def run(self) -> RecordGroup:
        """Make the run of its records as they lie in the file, whether or not they fit each other."""
        chunks = zip(self.episode.chunks, self.chunks, strict=True)
        runs = [(each.chunk, {channel: index.data for channel, index in at.indexes.items()}) for each, at in chunks]
        return RecordGroup.of(runs, self.facts.data)

    def check_whole(self) -> None:
        """Compare everything that is hashed with its hashes."""
        self.episode.check_records()
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

    def records(self, offset: int = len(MAGIC)) -> Iterator[McapRecord]:
        """Read the records from an offset on, to the footer or the end of the file."""
        while offset < len(self._data):
            record = self.record(offset)
            yield record
            if record.opcode == Opcode.FOOTER:
                return
            offset = record.end

    def read_robot_description(self) -> str:
        """Read the URDF text of the robot, which is among the latched messages that every file begins with."""
        try:
            table = read_latched_table(self.record(self.next_chunk(0)))
            message = table.messages(ROBOT_DESCRIPTION_ID)[0].tobytes()
            text: str = deserialize(message, get_message("std_msgs/msg/String")).data
        except (DatasetError, KeyError, ValueError) as error:
            raise DatasetError(f"/robot_description is not readable: {error}") from error
        return text

    def message_indexes(self, offset: int) -> tuple[dict[int, McapRecord], McapRecord]:
        """Read the Message Index records from an offset on, by channel, and the record that follows them."""
        indexes: dict[int, McapRecord] = {}
        record = self.record(offset)
        while record.opcode == Opcode.MESSAGE_INDEX:
            channel = int.from_bytes(record.data[_RECORD_HEADER.size : _RECORD_HEADER.size + 2], "little")
            if channel in indexes:
                raise DatasetError(f"a second message index of channel {channel}", place=f"byte {record.offset}")
            indexes[channel] = record
            record = self.record(record.end)
        return indexes, record

    def episode(self, first: McapRecord) -> StoredEpisode:
        """Read the episode whose first chunk a record is."""
        chunks: list[StoredChunk] = []
        record = first
        # Bounded, as a damaged file may have chunk after chunk and no metadata.
        while record.opcode == Opcode.CHUNK and len(chunks) < MOST_CHUNKS:
            indexes, following = self.message_indexes(record.end)
            chunks.append(StoredChunk(record, indexes))
            record = following
        if not chunks:
            raise DatasetError(f"a {record.kind} where the chunk of an episode should be", place=f"byte {first.offset}")
        metadata = record.parse(records.Metadata) if record.opcode == Opcode.METADATA else None
        if metadata is None or metadata.name != EPISODE:
            place = f"byte {record.offset}"
            raise DatasetError(f"a {record.kind} where the metadata of an episode should be", place=place)
        try:
            return StoredEpisode.of(chunks, record, metadata.metadata)
        except DatasetError as error:
            raise error.locate(place=f"byte {first.offset}") from error


def read_latched_table(record: McapRecord) -> MessageTable:
    """Read the messages of the chunk of the latched topics."""
    return MessageTable(Chunk.parse(record.data).decompress(), 1)


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
