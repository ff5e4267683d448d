"""Reads the records of one MCAP file of a dataset, trusting nothing in it."""

from __future__ import annotations

import io
import mmap
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

from throwcollect.dataset.mcap_file import EPISODE, MAGIC
from throwcollect.episode.chunk import CHUNK_HEADER_BYTES, CHUNK_MARK, CHUNK_MARK_OFFSET, Chunk
from throwcollect.episode.message import Episode, make_episode
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable

_RECORD_HEADER = struct.Struct("<BQ")
_R = TypeVar("_R", covariant=True)


class _Kind(Protocol[_R]):
    """Class of an MCAP record that can be read without its length."""

    def read(self, stream: ReadDataStream) -> _R: ...


class Record(NamedTuple):
    """One record where it lies.

    Attributes:
        offset: Where it begins in the file [bytes].
        opcode: Its kind.
        data: Its bytes, with opcode and length.
    """

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
        return Opcode(self.opcode).name.lower() if self.opcode in set(Opcode) else f"record 0x{self.opcode:02x}"

    def parse(self, kind: _Kind[_R]) -> _R:
        """Its fields.

        Args:
            kind: Class of the record, not Message.

        Raises:
            DatasetError: If it is not such a record.
        """
        try:
            return kind.read(ReadDataStream(io.BytesIO(self.data[_RECORD_HEADER.size :])))
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            raise DatasetError(f"byte {self.offset}: {self.kind} record is not readable") from error


@dataclass(frozen=True)
class StoredEpisode:
    """An episode's run of records as it lies in a file.

    Attributes:
        episode: The episode.
        chunk: Record of its chunk.
        indexes: Records of the chunk's message indexes, by channel.
        facts: The Metadata record at its end.
    """

    episode: Episode
    chunk: Record
    indexes: Mapping[int, Record]
    facts: Record


class McapContents:
    """The bytes of a file, read record by record.

    Args:
        data: The whole file.
    """

    def __init__(self, data: mmap.mmap | bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def slice(self, start: int, end: int) -> bytes:
        """Bytes of the file from `start` to `end`, not included."""
        return self._data[start:end]

    def record(self, offset: int) -> Record:
        """The record that begins at an offset.

        Raises:
            DatasetError: If the file ends before the record does.
        """
        header = self._data[offset : offset + _RECORD_HEADER.size]
        if offset < 0 or len(header) < _RECORD_HEADER.size:
            raise DatasetError(f"byte {offset}: the file is cut off")
        opcode, length = _RECORD_HEADER.unpack(header)
        end = offset + _RECORD_HEADER.size + length
        if end > len(self._data):
            raise DatasetError(f"byte {offset}: a record of {length} bytes goes beyond the end of the file")
        return Record(offset, opcode, self._data[offset:end])

    def find(self, pattern: bytes, start: int) -> int:
        """Where some bytes are first found from `start` on; -1 if nowhere."""
        return self._data.find(pattern, start)

    def next_chunk(self, start: int) -> int:
        """Where the first whole record from `start` on begins that looks like a chunk; -1 if none does.

        Records need not follow each other: chunks are found by the bytes that all their headers hold.
        """
        mark = self.find(CHUNK_MARK, start + CHUNK_MARK_OFFSET)
        while mark >= 0:
            offset = mark - CHUNK_MARK_OFFSET
            size = Chunk.announced_size(self._data[offset : offset + CHUNK_HEADER_BYTES])
            if 0 < size <= len(self._data) - offset:
                return offset
            mark = self.find(CHUNK_MARK, mark + 1)
        return -1

    def records(self, offset: int = len(MAGIC)) -> Iterator[Record]:
        """Records from an offset on, to the footer or the end of the file.

        Raises:
            DatasetError: If the file ends within a record.
        """
        while offset < len(self._data):
            record = self.record(offset)
            yield record
            if record.opcode == Opcode.FOOTER:
                return
            offset = record.end

    def message_indexes(self, offset: int) -> tuple[dict[int, Record], Record]:
        """The Message Index records from an offset on, by channel, and the record that follows them.

        Raises:
            DatasetError: If the file ends before that, or a channel has more than one.
        """
        indexes: dict[int, Record] = {}
        record = self.record(offset)
        while record.opcode == Opcode.MESSAGE_INDEX:
            channel = int.from_bytes(record.data[_RECORD_HEADER.size : _RECORD_HEADER.size + 2], "little")
            if channel in indexes:
                raise DatasetError(f"byte {record.offset}: a second message index of channel {channel}")
            indexes[channel] = record
            record = self.record(record.end)
        return indexes, record

    def episode(self, offset: int) -> StoredEpisode:
        """The episode whose chunk begins at an offset.

        Raises:
            DatasetError: If none does, or its records are damaged; the contents of the chunk are not looked at.
        """
        chunk = self.record(offset)
        if chunk.opcode != Opcode.CHUNK:
            raise DatasetError(f"byte {offset}: a {chunk.kind} where the chunk of an episode should be")
        indexes, record = self.message_indexes(chunk.end)
        if record.opcode != Opcode.METADATA or (facts := record.parse(records.Metadata)).name != EPISODE:
            raise DatasetError(f"byte {record.offset}: a {record.kind} where the metadata of an episode should be")
        try:
            said = facts.metadata
            episode = make_episode(
                said.get("header", ""), said.get("records_sha256", "").encode(), Chunk.parse(chunk.data)
            )
        except DatasetError as error:
            raise DatasetError(f"byte {offset}: {error}") from error
        return StoredEpisode(episode, chunk, indexes, record)


@contextmanager
def mapped(path: Path) -> Iterator[McapContents]:
    """The contents of a file, mapped into memory while the block lasts, whatever they are.

    Raises:
        DatasetError: If the file is missing, cannot be read, or is no regular file.
    """
    try:
        descriptor = open_regular(path)
        try:
            size = os.fstat(descriptor).st_size
            data = mmap.mmap(descriptor, 0, access=mmap.ACCESS_READ) if size else b""
        finally:
            os.close(descriptor)
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        yield McapContents(data)
    finally:
        if isinstance(data, mmap.mmap):
            data.close()


@contextmanager
def opened(path: Path) -> Iterator[McapContents]:
    """The contents of an MCAP file, mapped into memory while the block lasts.

    Raises:
        DatasetError: If the file is missing, cannot be read, or is no MCAP file.
    """
    with mapped(path) as contents:
        if contents.slice(0, len(MAGIC)) != MAGIC:
            raise DatasetError(f"{path}: not an MCAP file")
        yield contents
