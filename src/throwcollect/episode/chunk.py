"""MCAP chunks: packs, indexes and reads them.

The state chunk of an episode holds one Message record per channel and sample, samples in order of time and channels by
number (MCAP specification, records Message, Chunk and Message Index); `encoder` writes it, `message_table` reads it.
"""

from __future__ import annotations

import hashlib
import struct
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.errors import DatasetError

_COMPRESSION = b"zstd"
_CHUNK_HEADER = struct.Struct("<BQQQQII4sQ")
"""Opcode, length, start and end time, uncompressed size and CRC, length and name of the compression, size of data."""
CHUNK_HEADER_BYTES = _CHUNK_HEADER.size
CHUNK_MARK_OFFSET = 37
CHUNK_MARK = struct.pack("<I4s", len(_COMPRESSION), _COMPRESSION)
"""Bytes that the record of every chunk has at `CHUNK_MARK_OFFSET`: the length and the name of the compression."""
MOST_RATIO, HARMLESS_BYTES = 4096, 64 * 2**20
"""Most uncompressed bytes per compressed byte of a chunk with more than so many bytes. Recorded samples stay far below
this; zstd alone reaches 30,000, with which a small file could fill all memory."""
RECORD_PREFIX_BYTES = 9
"""Size of opcode and length of a record; the length does not count them."""
MESSAGE_HEADER = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time."""
_MESSAGE_INDEX_HEADER = struct.Struct("<BQHI")
"""Opcode, length, channel, size of the entries."""
_INDEX_ENTRY_BYTES = 16
"""Log time and offset of one message in a message index."""


class _OfEachThread(threading.local):
    """A decompressor for each thread: threads must not share one, and making one takes as long as using it."""

    def __init__(self) -> None:
        self.decompressor = zstandard.ZstdDecompressor()


_of_this_thread = _OfEachThread()


def encode_records(*parts: records.McapRecord) -> bytes:
    """Encode MCAP records, one after the other."""
    builder = RecordBuilder()
    for part in parts:
        part.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def encode_message_index(channel: int, log_times: NDArray[np.uint64], offsets: NDArray[np.integer[Any]]) -> bytes:
    """Encode the MCAP Message Index record of one channel.

    It has the times [ns] of its messages and the offsets of their records in the uncompressed chunk [bytes].
    """
    entries = np.empty((len(log_times), 2), "<u8")
    entries[:, 0] = log_times
    entries[:, 1] = offsets
    size = entries.nbytes
    return _MESSAGE_INDEX_HEADER.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size) + entries.tobytes()


def count_indexed(index: bytes) -> int:
    """Count the messages in a Message Index record of `encode_message_index`."""
    return (len(index) - _MESSAGE_INDEX_HEADER.size) // _INDEX_ENTRY_BYTES


@dataclass(frozen=True)
class Chunk:
    """A compressed MCAP chunk, which is decompressed when its contents are needed.

    Attributes:
        data: Compressed records (zstd); may be a view of the message or file that they came in.
        uncompressed_size: Size of the records [bytes].
        crc: CRC-32 of the records.
        start_ns: Time of the first message [ns].
        end_ns: Time of the last message [ns].
        records_sha256: SHA-256 of the records in hexadecimal, as it is written with the chunk; empty if it is not.
        indexes: MCAP Message Index records by channel, as they came with the chunk; empty if they did not.
    """

    data: bytes | memoryview
    uncompressed_size: int
    crc: int
    start_ns: int
    end_ns: int
    records_sha256: str = ""
    indexes: Mapping[int, bytes] = field(default_factory=dict, compare=False)

    @classmethod
    def of(cls, contents: bytes | bytearray | memoryview, data: bytes, *, start_ns: int, end_ns: int) -> Chunk:
        """Make the chunk of records, which are given both uncompressed and compressed."""
        return cls(data, len(contents), crc32(contents), start_ns, end_ns, hashlib.sha256(contents).hexdigest())

    @cached_property
    def contents(self) -> bytes:
        """The records, decompressed once."""
        return self.decompress()

    def check_records(self) -> None:
        """Hash the records and compare the hash with the one that was written with them."""
        actual = hashlib.sha256(self.contents).hexdigest()
        if actual != self.records_sha256:
            raise DatasetError(f"chunk: SHA-256 of its records is {actual}", expected=self.records_sha256)

    def record(self) -> bytes:
        """Encode the MCAP Chunk record, with its opcode and length."""
        return self.record_header() + self.data

    def record_header(self) -> bytes:
        """Encode the part of the record that comes before the data."""
        return _CHUNK_HEADER.pack(
            Opcode.CHUNK,
            self.record_size - RECORD_PREFIX_BYTES,
            self.start_ns,
            self.end_ns,
            self.uncompressed_size,
            self.crc,
            len(_COMPRESSION),
            _COMPRESSION,
            len(self.data),
        )

    @property
    def record_size(self) -> int:
        """Size of the record [bytes]."""
        return _CHUNK_HEADER.size + len(self.data)

    @staticmethod
    def read_announced_size(header: bytes) -> int:
        """Read the size of a record from its first `CHUNK_HEADER_BYTES`; 0 if `record` has not written them."""
        if len(header) != _CHUNK_HEADER.size:
            return 0
        opcode, length, *_, name_length, name, stored = _CHUNK_HEADER.unpack(header)
        is_ours = (opcode, name_length, name, length) == (
            Opcode.CHUNK, len(_COMPRESSION), _COMPRESSION, stored + _CHUNK_HEADER.size - RECORD_PREFIX_BYTES
        )  # fmt: skip
        return _CHUNK_HEADER.size + stored if is_ours else 0

    @classmethod
    def parse_run(cls, data: memoryview, hashes: Sequence[str]) -> list[Chunk]:
        """Read MCAP Chunk records, each with the Message Index records behind it, without decompressing them.

        Args:
            data: The records.
            hashes: SHA-256 of the records in each chunk, in hexadecimal.
        """
        chunks = []
        for records_sha256 in hashes:
            # Bytes that announce no size are taken as a whole, and `parse` refuses them.
            size = cls.read_announced_size(bytes(data[:CHUNK_HEADER_BYTES])) or len(data)
            chunk, data = cls.parse(data[:size]), data[size:]
            indexes: dict[int, bytes] = {}
            while data and data[0] == Opcode.MESSAGE_INDEX:
                _, _, channel, size = _MESSAGE_INDEX_HEADER.unpack_from(data)
                end = _MESSAGE_INDEX_HEADER.size + size
                indexes[channel], data = bytes(data[:end]), data[end:]
            chunks.append(replace(chunk, records_sha256=records_sha256, indexes=indexes))
        if data:
            raise DatasetError(f"chunk: {len(data)} bytes behind {len(hashes)} chunks")
        return chunks

    @classmethod
    def parse(cls, record: bytes | memoryview) -> Chunk:
        """Read an MCAP Chunk record that `record` has written, without decompressing it."""
        announced = cls.read_announced_size(bytes(record[:CHUNK_HEADER_BYTES]))
        if not announced or announced != len(record):
            raise DatasetError(f"chunk: {len(record)} bytes are not one record of a chunk compressed with zstd")
        _, _, start, end, size, crc, *_ = _CHUNK_HEADER.unpack_from(record)
        return cls(record[_CHUNK_HEADER.size :], size, crc, start, end)

    def check_size(self) -> None:
        """Check that the announced size of the records is plausible, without decompressing them."""
        try:
            size = zstandard.frame_content_size(self.data)
        except zstandard.ZstdError as error:
            raise DatasetError(f"chunk: cannot be decompressed: {error}") from error
        if size != self.uncompressed_size:
            raise DatasetError(f"chunk: holds {size} bytes", expected=f"{self.uncompressed_size} as announced")
        if size > max(MOST_RATIO * len(self.data), HARMLESS_BYTES):
            raise DatasetError(
                f"chunk: {len(self.data)} bytes of data announce {size}",
                expected=f"at most {MOST_RATIO} times as many",
            )

    def decompress(self) -> bytes:
        """Decompress the records."""
        self.check_size()
        try:
            contents = _of_this_thread.decompressor.decompress(self.data, allow_extra_data=False)
        except zstandard.ZstdError as error:
            raise DatasetError(f"chunk: cannot be decompressed: {error}") from error
        if crc32(contents) != self.crc:
            raise DatasetError("chunk: its CRC differs from its contents")
        return contents
