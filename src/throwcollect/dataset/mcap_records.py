"""Records of an MCAP file that the writer and the readers of datasets share: declarations, and runs of records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mcap import records

from rclzenoh.interfaces import message_definition, type_hash
from throwcollect.episode.channels import Channel
from throwcollect.episode.chunk import Chunk, count_indexed


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
    """Records that follow each other without a gap: chunks, each with its message indexes, and maybe a Metadata record.

    Attributes:
        data: The bytes.
        chunk_indexes: Index of each chunk, as if the run began at offset 0.
        counts: Number of messages on each channel, by its number.
        metadata_length: Size of the Metadata record at the end [bytes]; 0 if there is none.
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
        """Make the run of some chunks.

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
