"""MCAP chunks: how samples of one trial are encoded into one, and how chunks are packed, indexed and read again.

The state chunk of an episode holds one Message record per channel and sample, samples in order of time and channels by
number (MCAP specification, records Message, Chunk and Message Index); `message_table` reads it.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.episode.channels import Channels
from throwcollect.episode.layout import MessageLayout
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import Recording, Topic
from throwcollect.errors import DatasetError

_COMPRESSION = b"zstd"
_CHUNK_HEADER = struct.Struct("<BQQQQII4sQ")
"""Opcode, length, start and end time, uncompressed size and CRC, length and name of the compression, data's length."""
CHUNK_HEADER_BYTES = _CHUNK_HEADER.size
CHUNK_MARK_OFFSET = 37
CHUNK_MARK = struct.pack("<I4s", len(_COMPRESSION), _COMPRESSION)
"""Bytes that the record of every chunk has at `CHUNK_MARK_OFFSET`: the length and the name of the compression."""
MOST_RATIO = 4096
"""Uncompressed bytes that one compressed byte may stand for. Each message has a stamp of its own, so recordings stay
far below; zstd by itself reaches 30,000."""
RECORD_PREFIX_BYTES = 9
"""Opcode and length of a record, which its length leaves out."""
MESSAGE_HEADER = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time."""
_MESSAGE_INDEX_HEADER = struct.Struct("<BQHI")
"""Opcode, length, channel, size of the entries."""
_INDEX_ENTRY_BYTES = 16
"""Log time and offset of one message in a message index."""


class _OfEachThread(threading.local):
    """A decompressor must not be shared; making one takes almost as long as it then takes to decompress a chunk."""

    def __init__(self) -> None:
        self.decompressor = zstandard.ZstdDecompressor()


_of_this_thread = _OfEachThread()


def encode_records(*parts: records.McapRecord) -> bytes:
    """Bytes of MCAP records, one after the other."""
    builder = RecordBuilder()
    for part in parts:
        part.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def encode_message_index(channel: int, log_times: NDArray[np.uint64], offsets: NDArray[np.integer[Any]]) -> bytes:
    """The MCAP Message Index record of one channel.

    Args:
        channel: Number of the channel.
        log_times: Times of its messages [ns], shape ``(n,)``.
        offsets: Where their records begin in the uncompressed chunk [bytes], shape ``(n,)``.
    """
    entries = np.empty((len(log_times), 2), "<u8")
    entries[:, 0] = log_times
    entries[:, 1] = offsets
    size = entries.nbytes
    return _MESSAGE_INDEX_HEADER.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size) + entries.tobytes()


def count_indexed(index: bytes) -> int:
    """Number of messages that a Message Index record, as `encode_message_index` writes it, announces."""
    return (len(index) - _MESSAGE_INDEX_HEADER.size) // _INDEX_ENTRY_BYTES


@dataclass(frozen=True)
class Chunk:
    """A compressed MCAP chunk.

    Attributes:
        data: Compressed records (zstd); a view of the bytes that they came in spares a copy.
        uncompressed_size: Size of the records [bytes].
        crc: CRC-32 of the records.
        start_ns: Time of the first message [ns].
        end_ns: Time of the last message [ns].
    """

    data: bytes | memoryview
    uncompressed_size: int
    crc: int
    start_ns: int
    end_ns: int

    @classmethod
    def of(cls, contents: bytes | bytearray | memoryview, data: bytes, *, start_ns: int, end_ns: int) -> Chunk:
        """The chunk of some records.

        Args:
            contents: The records.
            data: The same, compressed.
            start_ns: Time of the first message [ns].
            end_ns: Time of the last message [ns].
        """
        return cls(data, len(contents), crc32(contents), start_ns, end_ns)

    def record(self) -> bytes:
        """The MCAP Chunk record, with its opcode and length."""
        return self.record_header() + self.data

    def record_header(self) -> bytes:
        """Everything of the record that comes before the data."""
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
        """Size of what `record` gives [bytes]."""
        return _CHUNK_HEADER.size + len(self.data)

    @staticmethod
    def read_announced_size(header: bytes) -> int:
        """Size of the record that begins with these bytes; 0 if that is no chunk as `record` writes it.

        Args:
            header: The first `CHUNK_HEADER_BYTES` of it.
        """
        if len(header) != _CHUNK_HEADER.size:
            return 0
        opcode, length, *_, name_length, name, stored = _CHUNK_HEADER.unpack(header)
        alike = (opcode, name_length, name, length) == (
            Opcode.CHUNK, len(_COMPRESSION), _COMPRESSION, stored + _CHUNK_HEADER.size - RECORD_PREFIX_BYTES
        )  # fmt: skip
        return _CHUNK_HEADER.size + stored if alike else 0

    @classmethod
    def parse_all(cls, records: memoryview) -> list[Chunk]:
        """Read MCAP Chunk records that follow each other, at least one.

        Raises:
            DatasetError: If the bytes are anything else; contents are not looked at.
        """
        chunks: list[Chunk] = []
        while records or not chunks:
            size = cls.read_announced_size(bytes(records[:CHUNK_HEADER_BYTES])) or len(records)
            chunks.append(cls.parse(records[:size]))
            records = records[size:]
        return chunks

    @classmethod
    def parse(cls, record: bytes | memoryview) -> Chunk:
        """Read an MCAP Chunk record as `record` writes it.

        Raises:
            DatasetError: If the bytes are anything else; contents are not looked at.
        """
        if len(record) < _CHUNK_HEADER.size:
            raise DatasetError(f"chunk: {len(record)} bytes", expected=f"at least {_CHUNK_HEADER.size}")
        opcode, length, start, end, size, crc, name_length, name, stored = _CHUNK_HEADER.unpack_from(record)
        if opcode != Opcode.CHUNK or (name_length, name) != (len(_COMPRESSION), _COMPRESSION):
            raise DatasetError("chunk: not the record of a chunk compressed with zstd")
        data = record[_CHUNK_HEADER.size :]
        if stored != len(data) or length != len(record) - RECORD_PREFIX_BYTES:
            raise DatasetError(f"chunk: announces {stored} bytes of data; got {len(data)}")
        return cls(data, size, crc, start, end)

    def check_size(self) -> None:
        """Check that the announced size of the records can be believed; no contents are decompressed.

        Raises:
            DatasetError: If the data are no zstd frame of that size, or it is more than such data can hold.
        """
        try:
            size = zstandard.frame_content_size(self.data)
        except zstandard.ZstdError as error:
            raise DatasetError(f"chunk: cannot be decompressed: {error}") from error
        if size != self.uncompressed_size:
            raise DatasetError(f"chunk: holds {size} bytes", expected=f"{self.uncompressed_size} as announced")
        if size > MOST_RATIO * len(self.data):
            raise DatasetError(
                f"chunk: {len(self.data)} bytes of data announce {size}",
                expected=f"at most {MOST_RATIO} times as many",
            )

    def decompress(self) -> bytes:
        """The uncompressed records.

        Raises:
            DatasetError: If the data are not one zstd frame of the announced size, or the CRC differs.
        """
        self.check_size()
        try:
            contents = _of_this_thread.decompressor.decompress(self.data, allow_extra_data=False)
        except zstandard.ZstdError as error:
            raise DatasetError(f"chunk: cannot be decompressed: {error}") from error
        if crc32(contents) != self.crc:
            raise DatasetError("chunk: its CRC differs from its contents")
        return contents


class ChunkEncoder:
    """Encodes samples for one configuration.

    Args:
        channels: What is recorded.
        level: zstd compression level.
    """

    def __init__(self, channels: Channels, *, level: int) -> None:
        self._topics = {topic.name: topic for topic in channels.recorded.values()}
        self._compressor = zstandard.ZstdCompressor(level=level)
        layouts = {channel.id: topic.layout for channel, topic in channels.recorded.items()}
        self._template = np.frombuffer(
            b"".join(MESSAGE_HEADER.pack(Opcode.MESSAGE, 22 + len(layout.template), number, 0, 0, 0) + layout.template
                     for number, layout in layouts.items()),
            dtype=np.uint8,
        )  # fmt: skip
        self._dtype = _row_type({topic.name: topic.layout for topic in channels.recorded.values()})

    def encode(self, samples: Samples, controllers: Mapping[str, ControllerSamples] | None = None) -> Chunk:
        """Encode and compress an episode; see `lay_out`."""
        return self.compress(self.lay_out(samples, controllers), samples)

    def lay_out(self, samples: Samples, controllers: Mapping[str, ControllerSamples] | None = None) -> memoryview:
        """The message records of an episode.

        Args:
            samples: The samples, at least one.
            controllers: Set points of each controller whose state is recorded, by its name.

        Raises:
            KeyError: If the set points of a recorded controller are missing.
        """
        recording = Recording(samples, controllers or {})
        table = np.empty((len(samples), len(self._template)), np.uint8)
        table[:] = self._template
        rows = table.view(self._dtype)[:, 0]
        for name, topic in self._topics.items():
            column = rows[name]
            column["sequence"] = np.arange(len(samples))
            column["log_time"] = column["publish_time"] = samples.stamps_ns
            topic.fill(column["message"], recording)
        return table.data.cast("B")

    def compress(self, contents: memoryview, samples: Samples) -> Chunk:
        """The chunk of the records that were laid out of samples."""
        start, end = int(samples.stamps_ns[0]), int(samples.stamps_ns[-1])
        return Chunk.of(contents, self._compressor.compress(contents), start_ns=start, end_ns=end)


def encode_message(topic: Topic, samples: Samples, index: int, controllers: Mapping[str, ControllerSamples]) -> bytes:
    """The message of one sample on a topic, byte for byte as `ChunkEncoder.encode` writes it.

    Args:
        topic: The topic, recorded or not.
        samples: Samples.
        index: Number of the sample, counted from 0.
        controllers: Set points of the controllers, by name.

    Raises:
        KeyError: If the set points of the topic's controller are missing.
    """
    message = bytearray(topic.layout.template)
    one = slice(index, index + 1)
    recording = Recording(samples[one], {name: target[one] for name, target in controllers.items()})
    topic.fill(np.frombuffer(message, topic.layout.dtype), recording)
    return bytes(message)


def _row_type(layouts: Mapping[str, MessageLayout]) -> np.dtype[np.void]:
    formats = [
        np.dtype(
            {
                "names": ["sequence", "log_time", "publish_time", "message"],
                "formats": ["<u4", "<u8", "<u8", layout.dtype],
                "offsets": [11, 15, 23, MESSAGE_HEADER.size],
                "itemsize": MESSAGE_HEADER.size + len(layout.template),
            }
        )
        for layout in layouts.values()
    ]
    return np.dtype({"names": list(layouts), "formats": formats})
