"""One MCAP file of a dataset, written record by record.

The file starts with all schemas and channels and a chunk with the latched messages. Each episode is one uninterrupted
run of records: its chunks, each with message indexes, and a Metadata record named `EPISODE` that describes it. The
first chunk has the samples, and those behind it what sensors saw.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from rclzenoh.interfaces import message_definition, type_hash
from throwcollect.dataset.bag import FileSummary, bag_information, to_yaml
from throwcollect.dataset.directory import LIBRARY
from throwcollect.episode.channels import Channel, Channels
from throwcollect.episode.chunk import Chunk, count_indexed, encode_records
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import MessageTable

MAGIC = b"\x89MCAP0\r\n"
EPISODE = "throwcollect.episode"
"""Name of the Metadata record that ends the run of an episode."""
BAG = "rosbag2"
"""Name of the Metadata record in which rosbag2 looks for a copy of the bag's metadata."""
PROFILE = "ros2"

_LATCHED_LEVEL = 9


def declarations(channels: Sequence[Channel]) -> tuple[list[records.Schema], list[records.Channel]]:
    """Make the Schema and Channel records, as rosbag2 writes them."""
    types = list(dict.fromkeys(channel.type_name for channel in channels))
    schemas = [
        records.Schema(id=number, data=message_definition(name).encode(), encoding="ros2msg", name=name)
        # In MCAP, schema 0 means no schema.
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
class RecordGroup:
    """Records that follow each other without a gap: chunks with their message indexes, and maybe a Metadata record.

    Attributes:
        chunk_indexes: Indexes of the chunks, as if the run began at offset 0.
        counts: Number of messages on each channel, by its number.
        metadata_length: Size of the Metadata record at the end [bytes]; 0 if there is none.
        offset: Where the run begins in a file [bytes], if it lies in one.
    """

    data: bytes
    chunk_indexes: tuple[records.ChunkIndex, ...]
    counts: Mapping[int, int]
    metadata_length: int
    offset: int = 0

    @property
    def length(self) -> int:
        """Size of the records [bytes]."""
        last = self.chunk_indexes[-1]
        end = last.chunk_start_offset + last.chunk_length + last.message_index_length
        return int(end) + self.metadata_length

    @property
    def end(self) -> int:
        """Where the run ends in a file [bytes]."""
        return self.offset + self.length

    @property
    def start_ns(self) -> int:
        """Time of the first message of its first chunk [ns]."""
        return int(self.chunk_indexes[0].message_start_time)

    @classmethod
    def of(cls, chunks: Iterable[Chunk], metadata: bytes = b"") -> RecordGroup:
        """Make the run of chunks with their Message Index records, and of a Metadata record."""
        chunk_indexes, counts, parts, start = [], Counter[int](), [], 0
        for chunk in chunks:
            offsets, offset = {}, start + chunk.record_size
            for channel, index in chunk.indexes.items():
                offsets[channel] = offset
                offset += len(index)
                counts[channel] += count_indexed(index)
            chunk_indexes.append(
                records.ChunkIndex(
                    chunk_length=chunk.record_size,
                    chunk_start_offset=start,
                    compression="zstd",
                    compressed_size=len(chunk.data),
                    message_end_time=chunk.end_ns,
                    message_index_length=offset - start - chunk.record_size,
                    message_index_offsets=offsets,
                    message_start_time=chunk.start_ns,
                    uncompressed_size=chunk.uncompressed_size,
                )
            )
            parts += [chunk.record_header(), chunk.data, *chunk.indexes.values()]
            start = offset
        return cls(b"".join((*parts, metadata)), tuple(chunk_indexes), counts, len(metadata))

    def indexes_from(self, start: int) -> Iterator[records.ChunkIndex]:
        """Make the indexes of the chunks of the run if it begins at an offset of a file [bytes]."""
        for index in self.chunk_indexes:
            offsets = {channel: start + offset for channel, offset in index.message_index_offsets.items()}
            yield replace(index, chunk_start_offset=start + index.chunk_start_offset, message_index_offsets=offsets)


def episode_run(episode: Episode) -> RecordGroup:
    """Encode the records of an episode."""
    facts = {
        "trial": str(episode.header.trial),
        "digest": episode.digest,
        "records_sha256": episode.chunk.records_sha256,
        "header": episode.header_json,
    }
    if episode.sensors:
        facts["sensors_sha256"] = " ".join(chunk.records_sha256 for chunk in episode.sensors)
    chunk = episode.chunk if episode.chunk.indexes else replace(episode.chunk, indexes=episode.message_indexes)
    return RecordGroup.of((chunk, *episode.sensors), encode_records(records.Metadata(EPISODE, facts)))


class McapFile:
    """Writes one file from its beginning; `size` is the number of bytes so far.

    Args:
        write: Called with the bytes of whole records, in order.
        channels: What is recorded.
        start_ns: Time of the latched messages [ns]: that of the first sample in the file.
    """

    def __init__(self, write: Callable[[bytes], None], channels: Channels, *, start_ns: int) -> None:
        self._write = write
        self.size = 0
        self._crc = 0
        self._channels = channels
        self._declarations = declarations(channels.all)
        self._chunk_indexes: list[records.ChunkIndex] = []
        self._metadata_indexes: list[records.MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        schemas, declared = self._declarations
        self._put(MAGIC + encode_records(records.Header(PROFILE, LIBRARY), *schemas, *declared))
        self.append(encode_latched_run(channels, start_ns))

    def append(self, run: RecordGroup) -> None:
        """Write a run of records, such as that of an episode."""
        self._chunk_indexes += run.indexes_from(self.size)
        self._counts.update(run.counts)
        if run.metadata_length:
            start = self.size + run.length - run.metadata_length
            self._metadata_indexes.append(records.MetadataIndex(start, run.metadata_length, EPISODE))
        self._put(run.data)

    def finish(self, name: str) -> FileSummary:
        """Write everything that follows the last episode; returns what the bag's metadata have of this file.

        The name also stands in the copy of the bag's metadata that rosbag2 looks for in each file.
        """
        start_ns = min(index.message_start_time for index in self._chunk_indexes)
        end_ns = max(index.message_end_time for index in self._chunk_indexes)
        summary = FileSummary(name, start_ns, end_ns, dict(sorted(self._counts.items())))
        # rosbag2 reads its metadata from each file, too, as if that were the whole bag.
        metadata = {"serialized_metadata": to_yaml(bag_information([summary], self._channels.all, {}))}
        bag = encode_records(records.Metadata(BAG, metadata))
        self._metadata_indexes.append(records.MetadataIndex(self.size, len(bag), BAG))
        self._put(bag)
        # This CRC covers everything from the first byte of the file to this record (MCAP specification, Data End).
        self._put(encode_records(records.DataEnd(self._crc)))
        self._put(self._encode_summary_section(summary) + MAGIC)
        return summary

    def _encode_summary_section(self, summary: FileSummary) -> bytes:
        """Encode everything between the end of the data and the closing magic (MCAP specification, Summary Section)."""
        schemas, channels = self._declarations
        statistics = records.Statistics(
            attachment_count=0,
            channel_count=len(channels),
            channel_message_counts=dict(summary.counts),
            chunk_count=len(self._chunk_indexes),
            message_count=summary.messages,
            message_end_time=summary.end_ns,
            message_start_time=summary.start_ns,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(schemas),
        )
        groups: dict[Opcode, Sequence[records.McapRecord]] = {
            Opcode.SCHEMA: schemas,
            Opcode.CHANNEL: channels,
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: self._chunk_indexes,
            Opcode.METADATA_INDEX: self._metadata_indexes,
        }
        offset = self.size
        parts, offsets = [], []
        for opcode, group in groups.items():
            part = encode_records(*group)
            offsets.append(records.SummaryOffset(opcode, offset, len(part)))
            offset += len(part)
            parts.append(part)
        contents = b"".join((*parts, encode_records(*offsets)))
        # The CRC of the summary also covers the footer up to the CRC itself (MCAP specification, Footer).
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, self.size, offset)
        crc = zlib.crc32(footer, zlib.crc32(contents))
        return contents + encode_records(records.Footer(self.size, offset, crc))

    def _put(self, data: bytes) -> None:
        self._write(data)
        self._crc = crc32(data, self._crc)
        self.size += len(data)


def encode_latched_run(channels: Channels, stamp_ns: int) -> RecordGroup:
    """Encode the latched messages: a chunk and its message indexes."""
    messages = channels.encode_latched_messages(stamp_ns).items()
    encoded = [records.Message(channel.id, stamp_ns, data, stamp_ns, 0) for channel, data in messages]
    compressor = zstandard.ZstdCompressor(level=_LATCHED_LEVEL)
    return RecordGroup.of([MessageTable(encode_records(*encoded), 1).compress(compressor, np.array([stamp_ns]))])
