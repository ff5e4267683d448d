"""Message records of an uncompressed chunk, seen in place as rows of equal size.

All messages of a channel have the same size, so a chunk is a table: one row per sample, with the record of each channel
at a constant place in each row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.episode.channels import (
    FIRST_BODY_ID,
    JOINT_STATES_ID,
    OBJECT_ODOMETRY_ID,
    POLICY_COMMAND_ID,
    Channels,
)
from throwcollect.episode.chunk import (
    MESSAGE_HEADER,
    RECORD_PREFIX_BYTES,
    Chunk,
    count_indexed,
    encode_message_index,
)
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import (
    BODY_FIELDS,
    STAMP,
    Rows,
    joint_states,
    odometry,
    policy_command,
    read_body_name,
    read_joint_names,
    read_policy_joints,
    read_stamps,
    rotate,
)
from throwcollect.errors import DatasetError

MOST_FRAMES_BYTES, _MOST_FRAME_BYTES = 4 * 2**20, 160 * 2**20
"""Most bytes of a chunk with frames, as players decompress a whole one to show a single picture; and of one frame."""
_HEADERS = np.dtype(
    {
        "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
    }
)
"""`MESSAGE_HEADER`, of many records at once."""
_JOINT_FIELDS = {
    "stamps_ns": "header.stamp.sec",
    "position": "position",
    "velocity": "velocity",
    "effort": "effort",
}
"""Attributes of `Samples`, and the fields of joint states that hold them."""


def list_body_fields(number: int) -> dict[str, str]:
    """List the fields of rows that belong to a body, by what they hold: the object, number 0, or another one."""
    return {part: f"body_{number}_{part}" if number else f"object_{part}" for part in BODY_FIELDS}


@cache
def _make_row_type(
    joints: tuple[str, ...], bodies: tuple[str, ...], starts: tuple[int, ...], size: int
) -> np.dtype[np.void]:
    """Make the type of a row of `size` bytes with the messages of joint states and odometry at `starts`.

    Each field is a run of bytes, so that NumPy copies a whole row of it at a time, aligned or not.
    """
    names, formats, offsets = [], [], []
    topics = joint_states(joints), *(odometry(name, number) for number, name in enumerate(bodies))
    fields = [_JOINT_FIELDS]
    for number in range(len(bodies)):
        held = list_body_fields(number)
        fields.append({held[part]: field for part, field in BODY_FIELDS.items()})
    for topic, start, columns in zip(topics, starts, fields, strict=True):
        places = dict(topic.layout.dtype.fields or {})
        for name, field in columns.items():
            kind, offset = places[field][:2]
            names.append(name)
            # The nanoseconds lie right behind the seconds, so both are one run of bytes.
            formats.append(f"V{STAMP.itemsize if name == 'stamps_ns' else kind.itemsize}")
            offsets.append(start + offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


def read_column(rows: Rows, name: str) -> NDArray[Any]:
    """Copy a field of `MessageTable.rows`: stamps [ns] of shape ``(n_samples,)``, or ``(n_samples, n)``."""
    column = np.ascontiguousarray(rows[name])
    return (
        read_stamps(column.view(STAMP), "stamp") if name == "stamps_ns" else column.view("<f8").reshape(len(rows), -1)
    )


class MessageTable:
    """The records of a chunk seen as a table, without a copy; every row has the same channels at the same places.

    Only the layout of the first row is checked. Views of a bytearray are writable.

    Attributes:
        contents: The records.
        columns: Where the record of each channel lies in every row, by the channel's number.

    Raises:
        DatasetError: If the contents cannot be this number of rows, or the first row is not one message per channel.
    """

    def __init__(self, contents: bytes | bytearray | memoryview, samples: int) -> None:
        if samples < 1 or len(contents) % samples or not contents:
            raise DatasetError(f"chunk: {len(contents)} bytes are not the records of {samples} samples")
        self.contents = contents
        self._table: NDArray[np.uint8] = np.frombuffer(contents, np.uint8).reshape(samples, -1)
        self.columns: dict[int, slice] = {}
        width, offset = self._table.shape[1], 0
        while offset < width:
            if width - offset < MESSAGE_HEADER.size:
                raise DatasetError(f"chunk: a record is cut off at byte {offset}")
            opcode, length, channel, *_ = MESSAGE_HEADER.unpack_from(contents, offset)
            start, offset = offset, offset + RECORD_PREFIX_BYTES + length
            fits = start + MESSAGE_HEADER.size <= offset <= width
            if opcode != Opcode.MESSAGE or not fits or channel in self.columns:
                raise DatasetError(f"chunk: not one message per channel and sample at byte {start}")
            self.columns[channel] = slice(start, offset)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns of joints: those that the first joint state has."""
        return read_joint_names(self._read_first_message(JOINT_STATES_ID, "/joint_states"))

    def _read_first_message(self, channel: int, topic: str) -> bytes:
        if channel not in self.columns:
            raise DatasetError(f"chunk: no messages of {topic}")
        first: NDArray[np.uint8] = self.messages(channel)[0]
        return first.tobytes()

    def __len__(self) -> int:
        return len(self._table)

    def headers(self, channel: int) -> Rows:
        """View sequence numbers and times of one channel's records, shape ``(n_samples,)``."""
        column = self.columns[channel]
        return self._table[:, column.start : column.start + _HEADERS.itemsize].view(_HEADERS)[:, 0]

    def messages(self, channel: int) -> NDArray[np.uint8]:
        """View the CDR messages of one channel, shape ``(n_samples, size)``."""
        column = self.columns[channel]
        return self._table[:, column.start + MESSAGE_HEADER.size : column.stop]

    @property
    def message_indexes(self) -> dict[int, bytes]:
        """The MCAP Message Index records of all channels, by channel: log time and offset of each message."""
        rows = np.arange(0, self._table.size, self._table.shape[1])
        return {
            channel: encode_message_index(channel, self.headers(channel)["log_time"], column.start + rows)
            for channel, column in self.columns.items()
        }

    def compress(self, compressor: zstandard.ZstdCompressor, log_times_ns: NDArray[np.int64]) -> Chunk:
        """Make the chunk of the records, which have these times, with its message indexes."""
        start_ns, end_ns = int(log_times_ns[0]), int(log_times_ns[-1])
        chunk = Chunk.of(self.contents, compressor.compress(self.contents), start_ns=start_ns, end_ns=end_ns)
        return replace(chunk, indexes=self.message_indexes)

    def rows(self, joints: tuple[str, ...]) -> Rows:
        """View the samples, which have these joints, shape ``(n_samples,)``: fields named as in `Samples`, as bytes.

        Fields of other bodies than the object are named by `list_body_fields`. Velocities of bodies are in their own
        frames. `read_column` copies a field.
        """
        topics = {JOINT_STATES_ID: joint_states(joints)}
        for number, (channel, name) in enumerate(self.bodies.items()):
            topics[channel] = odometry(name, number)
        for channel, topic in topics.items():
            if not topic.layout.describes_message(self._read_first_message(channel, topic.name)):
                raise DatasetError(
                    f"chunk: the messages of {topic.name} have another layout than {topic.type_name} written here"
                )
        starts = tuple(self.columns[channel].start + MESSAGE_HEADER.size for channel in topics)
        size, bodies = self._table.shape[1], tuple(self.bodies.values())
        return np.frombuffer(self.contents, _make_row_type(joints, bodies, starts, size))

    @cached_property
    def bodies(self) -> dict[int, str]:
        """Names of the bodies that move, by channel, with the object first."""
        others = sorted(channel for channel in self.columns if channel >= FIRST_BODY_ID)
        channels = (OBJECT_ODOMETRY_ID, *others)
        return {channel: read_body_name(self._read_first_message(channel, "odometry")) for channel in channels}

    @cached_property
    def samples(self) -> Samples:
        """The samples, copied from the records; velocities of bodies are turned back into world."""
        rows = self.rows(self.joints)
        # The numbers of each joint and each axis lie side by side, as arithmetic with them is several times as fast.
        columns = {name: np.asfortranarray(read_column(rows, name)) for name in rows.dtype.names or ()}
        others = []
        for number in range(len(self.bodies)):
            _, turn, *velocities = list_body_fields(number).values()
            turned = rotate(columns[turn], *(columns[name] for name in velocities), inverse=False)
            columns |= dict(zip(velocities, turned, strict=True))
            if number:
                others.append(np.hstack([columns.pop(name) for name in list_body_fields(number).values()]))
        if POLICY_COMMAND_ID in self.columns:
            columns["command"] = self._read_commands()
        samples = Samples(**columns)
        return replace(samples, bodies=np.stack(others, axis=1)) if others else samples

    def _read_commands(self) -> NDArray[np.float64]:
        joints = read_policy_joints(self._read_first_message(POLICY_COMMAND_ID, "/policy/command"))
        layout = policy_command(joints).layout
        messages = np.ascontiguousarray(self.messages(POLICY_COMMAND_ID))
        if messages.shape[1] != layout.dtype.itemsize:
            raise DatasetError("chunk: the messages of /policy/command have another layout than those written here")
        return np.array(messages.view(layout.dtype)[:, 0]["data"]).reshape(len(self), 2, len(joints))


def read_frames(chunk: Chunk) -> MessageTable:
    """Read the records of a chunk with frames of a sensor: one row a frame; `chunk` has its message indexes."""
    count = max(map(count_indexed, chunk.indexes.values()), default=0)
    if chunk.uncompressed_size > (most := MOST_FRAMES_BYTES if count > 1 else _MOST_FRAME_BYTES):
        raise DatasetError(f"chunk: announces {chunk.uncompressed_size} bytes of frames", expected=f"at most {most}")
    return MessageTable(chunk.contents, count)


def check_frames(chunk: Chunk) -> None:
    """Compare the records of a chunk with frames of a sensor with their hash and their message indexes."""
    table = read_frames(chunk)
    chunk.check_records()
    if table.message_indexes != chunk.indexes:
        raise DatasetError("chunk: the message indexes behind it do not fit it")


def make_row(layouts: Mapping[int, MessageLayout]) -> bytearray:
    """Make a row of message records without numbers, one for each channel, in order."""
    row = bytearray()
    for number, layout in layouts.items():
        length = MESSAGE_HEADER.size - RECORD_PREFIX_BYTES + len(layout.template)
        row += MESSAGE_HEADER.pack(Opcode.MESSAGE, length, number, 0, 0, 0) + layout.template
    return row


class ChunkEncoder:
    """Encodes samples for one configuration, with a level of zstd."""

    def __init__(self, channels: Channels, *, level: int) -> None:
        self._topics = {channel.id: topic for channel, topic in channels.recorded.items()}
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._row = make_row({number: topic.layout for number, topic in self._topics.items()})

    def encode(
        self, samples: Samples, controllers: Mapping[str, ControllerSamples] | None = None
    ) -> tuple[Chunk, MessageTable]:
        """Encode an episode, with set points of each controller whose state is recorded, by name.

        Returns:
            The state chunk with its message indexes, and its message records.
        """
        table = MessageTable(self._row * len(samples), len(samples))
        for channel, topic in self._topics.items():
            headers = table.headers(channel)
            headers["sequence"] = np.arange(len(samples))
            headers["log_time"] = headers["publish_time"] = samples.stamps_ns
            topic.fill(table.messages(channel).view(topic.layout.dtype)[:, 0], samples, controllers or {})
        return table.compress(self._compressor, samples.stamps_ns), table
