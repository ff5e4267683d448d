"""What an MCAP file holds, and the summary section that says so at its end (MCAP specification, Summary Section)."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from mcap import records
from mcap.opcode import Opcode

from rclzenoh.interfaces import message_definition, type_hash
from throwcollect.dataset.bag import FileSummary
from throwcollect.episode.channels import Channel
from throwcollect.episode.chunk import Chunk, count_indexed, encode_records

Groups = Mapping[Opcode, Sequence[records.McapRecord]]


def declarations(channels: Sequence[Channel]) -> tuple[list[records.Schema], list[records.Channel]]:
    """Schema and Channel records, as rosbag2 writes them."""
    types = list(dict.fromkeys(channel.type_name for channel in channels))
    schemas = [
        records.Schema(id=number, data=message_definition(name).encode(), encoding="ros2msg", name=name)
        for number, name in enumerate(types, start=1)
    ]
    return schemas, [
        records.Channel(
            id=channel.id,
            topic=channel.topic,
            message_encoding="cdr",
            metadata={"offered_qos_profiles": channel.qos.text, "topic_type_hash": type_hash(channel.type_name)},
            schema_id=types.index(channel.type_name) + 1,
        )
        for channel in channels
    ]


@dataclass(frozen=True)
class Run:
    """Records that follow each other without a gap, wherever they lie: chunks with their indexes, and what ends them.

    Attributes:
        data: The bytes.
        chunk_indexes: Index of each chunk, as if the run began at offset 0.
        counts: Number of messages on each channel, by its number.
        metadata_length: Size of the Metadata record at its end [bytes]; 0 if there is none.
    """

    data: bytes
    chunk_indexes: tuple[records.ChunkIndex, ...]
    counts: Mapping[int, int]
    metadata_length: int

    @property
    def length(self) -> int:
        """Size of the records [bytes]."""
        return _end_of(self.chunk_indexes[-1]) + self.metadata_length

    @property
    def start_ns(self) -> int:
        """Time of the first message of its first chunk [ns]."""
        return int(self.chunk_indexes[0].message_start_time)

    @classmethod
    def of(cls, chunks: Iterable[tuple[Chunk, Mapping[int, bytes]]], metadata: bytes = b"") -> Run:
        """The run of some chunks.

        Args:
            chunks: Each chunk with the Message Index records that follow it, by channel.
            metadata: The Metadata record at the end.
        """
        parts: list[bytes | memoryview] = []
        places: list[records.ChunkIndex] = []
        counts: dict[int, int] = {}
        for chunk, indexes in chunks:
            parts += (chunk.record_header(), chunk.data, *indexes.values())
            places.append(_index_chunk(chunk, indexes, _end_of(places[-1]) if places else 0))
            counts |= {channel: count_indexed(index) for channel, index in indexes.items()}
        return cls(b"".join((*parts, metadata)), tuple(places), counts, len(metadata))


def _index_chunk(chunk: Chunk, indexes: Mapping[int, bytes], start: int) -> records.ChunkIndex:
    """Index of a chunk that begins at `start` [bytes] and is followed by its message indexes."""
    end = start + chunk.record_size
    offsets, offset = {}, end
    for channel, index in indexes.items():
        offsets[channel] = offset
        offset += len(index)
    return records.ChunkIndex(
        chunk_length=chunk.record_size,
        chunk_start_offset=start,
        compression="zstd",
        compressed_size=len(chunk.data),
        message_end_time=chunk.end_ns,
        message_index_length=offset - end,
        message_index_offsets=offsets,
        message_start_time=chunk.start_ns,
        uncompressed_size=chunk.uncompressed_size,
    )


def _end_of(index: records.ChunkIndex) -> int:
    """Where the message indexes of a chunk end [bytes]."""
    return int(index.chunk_start_offset + index.chunk_length + index.message_index_length)


class FileContents:
    """Keeps count of what a file holds.

    Attributes:
        schemas: Schema records of the file.
        channels: Channel records of the file.

    Args:
        schemas: Schema records of the file.
        channels: Channel records of the file.
    """

    def __init__(self, schemas: list[records.Schema], channels: list[records.Channel]) -> None:
        self.schemas = schemas
        self.channels = channels
        self._chunk_indexes: list[records.ChunkIndex] = []
        self._metadata_indexes: list[records.MetadataIndex] = []
        self._counts: Counter[int] = Counter()

    def add_run(self, run: Run, start: int, name: str = "") -> None:
        """Count a run of records.

        Args:
            run: The run.
            start: Where it begins in the file [bytes].
            name: Name of the Metadata record at its end, if there is one.
        """
        for index in run.chunk_indexes:
            offsets = {channel: start + offset for channel, offset in index.message_index_offsets.items()}
            begins = start + index.chunk_start_offset
            self._chunk_indexes.append(replace(index, chunk_start_offset=begins, message_index_offsets=offsets))
        self._counts.update(run.counts)
        if run.metadata_length:
            self.add_metadata(name, start + run.length - run.metadata_length, run.metadata_length)

    def add_metadata(self, name: str, start: int, length: int) -> None:
        """Count a Metadata record."""
        self._metadata_indexes.append(records.MetadataIndex(start, length, name))

    def summary(self, name: str) -> FileSummary:
        """What the bag's metadata say of a file with at least one chunk.

        Args:
            name: Name of the file.
        """
        start = min(index.message_start_time for index in self._chunk_indexes)
        end = max(index.message_end_time for index in self._chunk_indexes)
        return FileSummary(name, start, end, dict(sorted(self._counts.items())))

    def groups(self) -> Groups:
        """Records of the summary section but for its offsets, by kind and in order."""
        summary = self.summary("")
        statistics = records.Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=dict(summary.counts),
            chunk_count=len(self._chunk_indexes),
            message_count=summary.messages,
            message_end_time=summary.end_ns,
            message_start_time=summary.start_ns,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self.schemas),
        )
        return {
            Opcode.SCHEMA: self.schemas,
            Opcode.CHANNEL: self.channels,
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: self._chunk_indexes,
            Opcode.METADATA_INDEX: self._metadata_indexes,
        }

    def section(self, start: int) -> bytes:
        """Everything between the end of the data and the closing magic: summary, its offsets, footer.

        Args:
            start: Where it begins [bytes].
        """
        offset = start
        parts, offsets = [], []
        for opcode, group in self.groups().items():
            part = encode_records(*group)
            offsets.append(records.SummaryOffset(opcode, offset, len(part)))
            offset += len(part)
            parts.append(part)
        contents = b"".join((*parts, encode_records(*offsets)))
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, start, offset)
        return contents + encode_records(records.Footer(start, offset, zlib.crc32(footer, zlib.crc32(contents))))
