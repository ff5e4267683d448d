"""Message records of an uncompressed chunk, seen in place as rows of equal size.

All messages of a channel have the same size, so a chunk is a table: one row per sample, with the record of each channel
at a constant place in each row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.episode.channels import BALL_ODOMETRY_ID, JOINT_STATES_ID, Channels
from throwcollect.episode.chunk import MESSAGE_HEADER, RECORD_PREFIX_BYTES, Chunk, encode_message_index
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import (
    Recording,
    Rows,
    Topic,
    ball_odometry,
    joint_states,
    read_joint_names,
    read_samples,
)
from throwcollect.errors import DatasetError

_HEADERS = np.dtype(
    {
        "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
    }
)
"""`MESSAGE_HEADER`, of many records at once."""
_ALIKE_BYTES = 11
"""Size of opcode, length and channel, which are the same in all records of a channel."""


class RecordPlace(NamedTuple):
    """Place of a record in a chunk. The records of a channel have the same place in each row as in the first."""

    offset: int
    size: int


class RowLayout:
    """The layout of the rows of a state chunk, as the first one shows it: each has one message of each channel.

    Attributes:
        columns: Place of each channel's record in a row, by the channel's number.

    Raises:
        DatasetError: If the contents cannot be this number of rows, or the first row is not one message per channel.
    """

    def __init__(self, contents: bytes | bytearray | memoryview, samples: int) -> None:
        if samples < 1 or len(contents) % samples or not contents:
            raise DatasetError(f"chunk: {len(contents)} bytes are not the records of {samples} samples")
        self._row = bytes(contents[: len(contents) // samples])
        self.columns: dict[int, RecordPlace] = {}
        offset = 0
        while offset < len(self._row):
            if len(self._row) - offset < MESSAGE_HEADER.size:
                raise DatasetError(f"chunk: a record is cut off at byte {offset}")
            opcode, length, channel, *_ = MESSAGE_HEADER.unpack_from(self._row, offset)
            column = RecordPlace(offset, RECORD_PREFIX_BYTES + length)
            offset += column.size
            fits = MESSAGE_HEADER.size <= column.size and offset <= len(self._row)
            if opcode != Opcode.MESSAGE or not fits or channel in self.columns:
                raise DatasetError(f"chunk: not one message per channel and sample at byte {column.offset}")
            self.columns[channel] = column

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns of joints: those that the first joint state has."""
        return read_joint_names(bytes(self._find_first_message(JOINT_STATES_ID, "/joint_states")))

    def check_topic(self, channel: int, topic: Topic) -> None:
        """Check that the message of a channel has the layout of a topic."""
        if not topic.layout.describes_message(self._find_first_message(channel, topic.name)):
            raise DatasetError(
                f"chunk: the messages of {topic.name} have another layout than {topic.type_name} written here"
            )

    def _find_first_message(self, channel: int, topic: str) -> bytes | bytearray:
        if channel not in self.columns:
            raise DatasetError(f"chunk: no messages of {topic}")
        column = self.columns[channel]
        return self._row[column.offset + MESSAGE_HEADER.size : column.offset + column.size]


class MessageTable(RowLayout):
    """The records of a chunk seen as a table, without a copy; every row has the same channels at the same places.

    Views of a bytearray are writable.

    Attributes:
        contents: The records.
        log_times: Time of each row's first record [ns], shape ``(n_samples,)``, uint64.

    Raises:
        DatasetError: If the records are not such a table.
    """

    def __init__(self, contents: bytes | bytearray | memoryview, samples: int) -> None:
        super().__init__(contents, samples)
        self.contents = contents
        self._table: NDArray[np.uint8] = np.frombuffer(contents, np.uint8).reshape(samples, -1)
        # Opcode, length and channel are the first bytes of a record: if they repeat in each row, so does the layout.
        for channel, column in self.columns.items():
            alike = self._table[:, column.offset : column.offset + _ALIKE_BYTES]
            if alike.tobytes() != alike[0].tobytes() * samples:
                raise DatasetError(f"chunk: the records of channel {channel} are not alike")
        self.log_times = self.headers(next(iter(self.columns)))["log_time"]

    def __len__(self) -> int:
        return len(self._table)

    def headers(self, channel: int) -> Rows:
        """View sequence numbers and times of one channel's records, shape ``(n_samples,)``."""
        column = self.columns[channel]
        return self._table[:, column.offset : column.offset + _HEADERS.itemsize].view(_HEADERS)[:, 0]

    def messages(self, channel: int) -> NDArray[np.uint8]:
        """View the CDR messages of one channel, shape ``(n_samples, size)``."""
        column = self.columns[channel]
        return self._table[:, column.offset + MESSAGE_HEADER.size : column.offset + column.size]

    def message_index(self, channel: int) -> bytes:
        """Encode the MCAP Message Index record of one channel: log time and offset in the chunk of each message."""
        offsets = np.arange(self.columns[channel].offset, self._table.size, self._table.shape[1])
        return encode_message_index(channel, self.headers(channel)["log_time"], offsets)

    @property
    def message_indexes(self) -> dict[int, bytes]:
        """The Message Index records of all channels, by channel."""
        return {channel: self.message_index(channel) for channel in self.columns}

    @cached_property
    def samples(self) -> Samples:
        """The samples, copied from the records."""
        topics = {JOINT_STATES_ID: joint_states(self.joints), BALL_ODOMETRY_ID: ball_odometry()}
        return read_samples(*(self._read(channel, topic) for channel, topic in topics.items()))

    def _read(self, channel: int, topic: Topic) -> Rows:
        self.check_topic(channel, topic)
        return self.messages(channel).view(topic.layout.dtype)[:, 0]


class ChunkEncoder:
    """Encodes samples for one configuration, with a level of zstd."""

    def __init__(self, channels: Channels, *, level: int) -> None:
        self._topics = {channel.id: topic for channel, topic in channels.recorded.items()}
        self._compressor = zstandard.ZstdCompressor(level=level)
        row = bytearray()
        for number, topic in self._topics.items():
            template = topic.layout.template
            length = MESSAGE_HEADER.size - RECORD_PREFIX_BYTES + len(template)
            row += MESSAGE_HEADER.pack(Opcode.MESSAGE, length, number, 0, 0, 0) + template
        self._row = row

    def encode(
        self, samples: Samples, controllers: Mapping[str, ControllerSamples] | None = None
    ) -> tuple[Chunk, MessageTable]:
        """Encode an episode, with set points of each controller whose state is recorded, by name.

        Returns:
            The state chunk with its message indexes, and its message records.
        """
        recording = Recording(samples, controllers or {})
        table = MessageTable(self._row * len(samples), len(samples))
        for channel, topic in self._topics.items():
            headers = table.headers(channel)
            headers["sequence"] = np.arange(len(samples))
            headers["log_time"] = headers["publish_time"] = samples.stamps_ns
            topic.fill(table.messages(channel).view(topic.layout.dtype)[:, 0], recording)
        data, times = self._compressor.compress(table.contents), table.log_times
        chunk = Chunk.of(table.contents, data, start_ns=int(times[0]), end_ns=int(times[-1]))
        return replace(chunk, indexes=table.message_indexes), table
