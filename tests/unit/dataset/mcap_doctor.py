"""Checks every record of an MCAP file as `mcap doctor` does, with only the `mcap` package and rosbags."""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MAGIC = b"\x89MCAP0\r\n"
SUMMARY = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.SUMMARY_OFFSET,
)


class Placed(NamedTuple):
    opcode: int
    offset: int
    length: int
    """Bytes, with opcode and length."""
    body: bytes


def read(kind: type[Any], body: bytes) -> Any:
    """The record in a body. There may be no bytes behind its fields."""
    stream = ReadDataStream(io.BytesIO(body))
    found = kind.read(stream, len(body)) if kind is records.Message else kind.read(stream)
    assert stream.count == len(body), f"{kind.__name__}: {len(body) - stream.count} bytes more than its fields"
    return found


def place_records(data: bytes, start: int, end: int) -> Iterator[Placed]:
    while start < end:
        opcode, length = struct.unpack_from("<BQ", data, start)
        assert start + 9 + length <= end, f"byte {start}: the record ends behind its section"
        yield Placed(opcode, start, 9 + length, data[start + 9 : start + 9 + length])
        start += 9 + length


class Examination:
    """What the records of a file say, compared with its summary.

    Raises:
        AssertionError: At the first thing that is wrong.
    """

    def __init__(self, path: Path) -> None:
        self.data = path.read_bytes()
        self.schemas: dict[int, records.Schema] = {}
        self.channels: dict[int, records.Channel] = {}
        self.chunk_indexes: list[records.ChunkIndex] = []
        self.metadata_indexes: list[records.MetadataIndex] = []
        self.counts: Counter[int] = Counter()
        self.times: list[int] = []
        self._unindexed: dict[int, list[tuple[int, int]]] = {}
        self._decode: dict[int, Callable[[bytes], None]] = {}
        assert self.data.startswith(MAGIC)
        assert self.data.endswith(MAGIC)
        end = len(self.data) - len(MAGIC)
        every = list(place_records(self.data, len(MAGIC), end))
        assert [every[0].opcode, every[-1].opcode] == [Opcode.HEADER, Opcode.FOOTER]
        read(records.Header, every[0].body)
        (border,) = [number for number, record in enumerate(every) if record.opcode == Opcode.DATA_END]
        for record in every[1:border]:
            self._take(record)
        assert not self._unindexed, "the last chunk lacks message indexes"
        assert read(records.DataEnd, every[border].body).data_section_crc == zlib.crc32(
            self.data[: every[border].offset]
        )
        self._compare(every[border + 1 : -1], every[-1])

    def _take(self, record: Placed) -> None:
        if record.opcode == Opcode.MESSAGE_INDEX:
            self._take_index(record)
            return
        assert not self._unindexed, f"byte {record.offset}: a chunk's message indexes are not behind it"
        if record.opcode == Opcode.SCHEMA:
            self._take_schema(read(records.Schema, record.body))
        elif record.opcode == Opcode.CHANNEL:
            self._take_channel(read(records.Channel, record.body))
        elif record.opcode == Opcode.CHUNK:
            self._take_chunk(record)
        else:
            assert record.opcode == Opcode.METADATA, f"byte {record.offset}: opcode {record.opcode}"
            name = read(records.Metadata, record.body).name
            self.metadata_indexes.append(records.MetadataIndex(record.offset, record.length, name))

    def _take_schema(self, schema: records.Schema) -> None:
        assert schema.id > 0
        assert self.schemas.setdefault(schema.id, schema) == schema, f"schema {schema.id} is declared twice"
        assert schema.encoding == "ros2msg"

    def _take_channel(self, channel: records.Channel) -> None:
        assert self.channels.setdefault(channel.id, channel) == channel, f"channel {channel.id} is declared twice"
        assert channel.message_encoding == "cdr"
        schema = self.schemas[channel.schema_id]
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(schema.data.decode(), schema.name))

        def decode(data: bytes) -> None:
            message = store.deserialize_cdr(data, schema.name)
            assert bytes(store.serialize_cdr(message, schema.name)) == data, f"{channel.topic}: not its schema"

        self._decode[channel.id] = decode

    def _take_chunk(self, record: Placed) -> None:
        chunk = read(records.Chunk, record.body)
        assert chunk.compression == "zstd"
        contents = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=chunk.uncompressed_size)
        assert (len(contents), zlib.crc32(contents)) == (chunk.uncompressed_size, chunk.uncompressed_crc)
        stamps = []
        for inner in place_records(contents, 0, len(contents)):
            if inner.opcode == Opcode.SCHEMA:
                self._take_schema(read(records.Schema, inner.body))
                continue
            if inner.opcode == Opcode.CHANNEL:
                self._take_channel(read(records.Channel, inner.body))
                continue
            assert inner.opcode == Opcode.MESSAGE
            message = read(records.Message, inner.body)
            self._decode[message.channel_id](message.data)
            assert not self.times or message.log_time >= self.times[-1], "log times run backwards"
            self.times.append(message.log_time)
            stamps.append(message.log_time)
            self.counts[message.channel_id] += 1
            self._unindexed.setdefault(message.channel_id, []).append((message.log_time, inner.offset))
        assert (chunk.message_start_time, chunk.message_end_time) == (min(stamps), max(stamps))
        self.chunk_indexes.append(
            records.ChunkIndex(
                chunk_length=record.length,
                chunk_start_offset=record.offset,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=max(stamps),
                message_index_length=0,
                message_index_offsets={},
                message_start_time=min(stamps),
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _take_index(self, record: Placed) -> None:
        index = read(records.MessageIndex, record.body)
        assert [tuple(entry) for entry in index.records] == self._unindexed.pop(index.channel_id)
        chunk = self.chunk_indexes[-1]
        self.chunk_indexes[-1] = replace(
            chunk,
            message_index_length=chunk.message_index_length + record.length,
            message_index_offsets={**chunk.message_index_offsets, index.channel_id: record.offset},
        )

    def _compare(self, summary: list[Placed], last: Placed) -> None:
        """Compare the summary section and the footer with the records of the file."""
        footer = read(records.Footer, last.body)
        groups = {
            opcode: [record for record in summary if record.opcode == opcode]
            for opcode in dict.fromkeys(record.opcode for record in summary)
        }
        assert set(groups) <= set(SUMMARY)
        assert [record for group in groups.values() for record in group] == summary, "a group is not in one piece"
        assert [read(records.Schema, each.body) for each in groups[Opcode.SCHEMA]] == list(self.schemas.values())
        assert [read(records.Channel, each.body) for each in groups[Opcode.CHANNEL]] == list(self.channels.values())
        assert [read(records.ChunkIndex, each.body) for each in groups[Opcode.CHUNK_INDEX]] == self.chunk_indexes
        found = [read(records.MetadataIndex, each.body) for each in groups.get(Opcode.METADATA_INDEX, [])]
        assert found == self.metadata_indexes
        (statistics,) = groups[Opcode.STATISTICS]
        assert read(records.Statistics, statistics.body) == records.Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=dict(self.counts),
            chunk_count=len(self.chunk_indexes),
            message_count=len(self.times),
            message_end_time=self.times[-1],
            message_start_time=self.times[0],
            metadata_count=len(self.metadata_indexes),
            schema_count=len(self.schemas),
        )
        offsets = groups.pop(Opcode.SUMMARY_OFFSET)
        told = [read(records.SummaryOffset, each.body) for each in offsets]
        # Some writers also list empty groups.
        assert [offset for offset in told if offset.group_length] == [
            records.SummaryOffset(opcode, group[0].offset, sum(record.length for record in group))
            for opcode, group in groups.items()
        ]
        assert (footer.summary_start, footer.summary_offset_start) == (summary[0].offset, offsets[0].offset)
        # All but the CRC itself, which are the last four bytes of the footer.
        assert footer.summary_crc == zlib.crc32(self.data[summary[0].offset : last.offset + last.length - 4])
