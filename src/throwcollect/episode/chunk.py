"""Samples of one trial as the records of one MCAP chunk, and back.

A chunk holds one Message record per channel and sample, samples in order of time and channels by number. As every
message of a channel has the same size, a chunk is a table: one row a sample, at a constant place in each row the record
of each channel (MCAP specification, records Message, Chunk and Message Index).
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.episode.channels import BALL_ODOMETRY_ID, JOINT_STATES_ID, Channels
from throwcollect.episode.layout import MessageLayout
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import Recording, Rows, Topic, ball_odometry, joint_states, read_samples
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
_PREFIX_BYTES = 9
"""Opcode and length, which a record's length leaves out."""
_MESSAGE_HEADER = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time."""
_MESSAGE_INDEX_HEADER = struct.Struct("<BQHI")
"""Opcode, length, channel, size of the entries."""
_MESSAGE_HEADERS = np.dtype(
    {
        "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
    }
)
"""`_MESSAGE_HEADER`, of many records at once."""
_ALIKE_BYTES = 11
"""Opcode, length and channel: what is the same at the start of all records of a channel."""


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

    def record(self) -> bytes:
        """The MCAP Chunk record, with its opcode and length."""
        return self.record_header() + self.data

    def record_header(self) -> bytes:
        """Everything of the record that comes before the data."""
        return _CHUNK_HEADER.pack(
            Opcode.CHUNK,
            self.record_size - _PREFIX_BYTES,
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
    def announced_size(header: bytes) -> int:
        """Size of the record that begins with these bytes; 0 if that is no chunk as `record` writes it.

        Args:
            header: The first `CHUNK_HEADER_BYTES` of it.
        """
        if len(header) != _CHUNK_HEADER.size:
            return 0
        opcode, length, *_, name_length, name, stored = _CHUNK_HEADER.unpack(header)
        alike = (opcode, name_length, name, length) == (
            Opcode.CHUNK, len(_COMPRESSION), _COMPRESSION, stored + _CHUNK_HEADER.size - _PREFIX_BYTES
        )  # fmt: skip
        return _CHUNK_HEADER.size + stored if alike else 0

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
        if stored != len(data) or length != len(record) - _PREFIX_BYTES:
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
            b"".join(_MESSAGE_HEADER.pack(Opcode.MESSAGE, 22 + len(layout.template), number, 0, 0, 0) + layout.template
                     for number, layout in layouts.items()),
            dtype=np.uint8,
        )  # fmt: skip
        self._dtype = _row_type({topic.name: topic.layout for topic in channels.recorded.values()})

    def encode(self, samples: Samples, controllers: Mapping[str, ControllerSamples] | None = None) -> Chunk:
        """Encode and compress an episode.

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
        return Chunk(
            data=self._compressor.compress(table.data),
            uncompressed_size=table.nbytes,
            crc=crc32(table.data),
            start_ns=int(samples.stamps_ns[0]),
            end_ns=int(samples.stamps_ns[-1]),
        )

    def message(
        self, topic: str, samples: Samples, index: int, controllers: Mapping[str, ControllerSamples] | None = None
    ) -> bytes:
        """The message of one sample on one topic, byte for byte as `encode` writes it.

        Args:
            topic: Name of a recorded topic.
            samples: Samples.
            index: Number of the sample, counted from 0.
            controllers: As for `encode`.

        Raises:
            KeyError: If the topic is not recorded, or its controller's set points are missing.
        """
        return encode_message(self._topics[topic], samples, index, controllers or {})


def encode_message(topic: Topic, samples: Samples, index: int, controllers: Mapping[str, ControllerSamples]) -> bytes:
    """The message of one sample on any topic; see `ChunkEncoder.message`.

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
                "offsets": [11, 15, 23, _MESSAGE_HEADER.size],
                "itemsize": _MESSAGE_HEADER.size + len(layout.template),
            }
        )
        for layout in layouts.values()
    ]
    return np.dtype({"names": list(layouts), "formats": formats})


class _Column(NamedTuple):
    """Where the records of one channel lie in each row."""

    offset: int
    size: int


class MessageTable:
    """The records of a chunk seen as a table, without a copy.

    Holding one guarantees that every row has the same channels at the same places.

    Attributes:
        columns: Place of each channel's record in a row, by the channel's number.
        log_times: Time of each row's first record [ns], shape ``(n_samples,)``, uint64.

    Args:
        contents: Uncompressed records; what is seen of a bytearray can be written to.
        samples: Number of samples.

    Raises:
        DatasetError: If the records are not such a table.
    """

    def __init__(self, contents: bytes | bytearray, samples: int) -> None:
        if samples < 1 or len(contents) % samples or not contents:
            raise DatasetError(f"chunk: {len(contents)} bytes are not the records of {samples} samples")
        self._table: NDArray[np.uint8] = np.frombuffer(contents, np.uint8).reshape(samples, -1)
        self.columns: dict[int, _Column] = {}
        width, offset = self._table.shape[1], 0
        while offset < width:
            header = contents[offset : offset + _MESSAGE_HEADER.size]
            if len(header) < _MESSAGE_HEADER.size:
                raise DatasetError(f"chunk: a record is cut off at byte {offset}")
            opcode, length, channel, *_ = _MESSAGE_HEADER.unpack(header)
            column = _Column(offset, 9 + length)
            offset += column.size
            if opcode != Opcode.MESSAGE or length < 22 or offset > width or channel in self.columns:
                raise DatasetError(f"chunk: not one message per channel and sample at byte {column.offset}")
            self.columns[channel] = column
            alike = self._table[:, column.offset : column.offset + _ALIKE_BYTES]
            if alike.tobytes() != header[:_ALIKE_BYTES] * samples:
                raise DatasetError(f"chunk: the records of channel {channel} are not alike")
        self.log_times = self.headers(next(iter(self.columns)))["log_time"]

    def __len__(self) -> int:
        return len(self._table)

    def headers(self, channel: int) -> Rows:
        """Sequence numbers and times of one channel's records, shape ``(n_samples,)``; a view.

        Raises:
            KeyError: If the chunk has no such channel.
        """
        column = self.columns[channel]
        return self._table[:, column.offset : column.offset + _MESSAGE_HEADERS.itemsize].view(_MESSAGE_HEADERS)[:, 0]

    def are_timed_by(self, stamps_ns: NDArray[np.int64]) -> bool:
        """Whether all records are numbered from 0 and logged and published at these times [ns], ``(n_samples,)``."""
        return all(
            np.array_equal(headers["sequence"], np.arange(len(self)))
            and np.array_equal(headers["log_time"], stamps_ns)
            and np.array_equal(headers["publish_time"], stamps_ns)
            for headers in map(self.headers, self.columns)
        )

    def messages(self, channel: int) -> NDArray[np.uint8]:
        """CDR messages of one channel, shape ``(n_samples, size)``.

        Raises:
            KeyError: If the chunk has no such channel.
        """
        column = self.columns[channel]
        return self._table[:, column.offset + _MESSAGE_HEADER.size : column.offset + column.size]

    def message_index(self, channel: int) -> bytes:
        """The MCAP Message Index record of one channel: log time and offset in the chunk of each of its messages.

        Raises:
            KeyError: If the chunk has no such channel.
        """
        entries = np.empty((len(self), 2), "<u8")
        entries[:, 0] = self.headers(channel)["log_time"]
        entries[:, 1] = np.arange(self.columns[channel].offset, self._table.size, self._table.shape[1])
        header = _MESSAGE_INDEX_HEADER.pack(Opcode.MESSAGE_INDEX, 6 + entries.nbytes, channel, entries.nbytes)
        return header + entries.tobytes()

    @cached_property
    def samples(self) -> Samples:
        """The samples; joint columns and the ball's pose are views of the records.

        Raises:
            DatasetError: If joint states or the ball's odometry are missing, or not laid out as they are written here.
        """
        topics = {JOINT_STATES_ID: joint_states(), BALL_ODOMETRY_ID: ball_odometry()}
        return read_samples(*(self._read(channel, topic) for channel, topic in topics.items()))

    def _read(self, channel: int, topic: Topic) -> Rows:
        if channel not in self.columns:
            raise DatasetError(f"chunk: no messages of {topic.name}")
        rows = self.messages(channel)
        if not topic.layout.describes(rows[:1]):
            raise DatasetError(
                f"chunk: the messages of {topic.name} have another layout than {topic.type_name} written here"
            )
        return rows.view(topic.layout.dtype)[:, 0]
