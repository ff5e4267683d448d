"""What an MCAP file holds, and the summary section that says so at its end (MCAP specification, Summary Section)."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mcap import records
from mcap.opcode import Opcode

from throwcollect.dataset.bag import FileSummary
from throwcollect.episode.channels import Channel
from throwcollect.episode.chunk import encode_records
from throwcollect.interfaces import message_definition, type_hash

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

    def add_chunk(self, index: records.ChunkIndex, start: int, messages: int) -> None:
        """Count a chunk with its message indexes.

        Args:
            index: Its index as if it began at offset 0.
            start: Where it begins [bytes].
            messages: Number of messages on each of its channels.
        """
        offsets = {channel: start + offset for channel, offset in index.message_index_offsets.items()}
        self._chunk_indexes.append(replace(index, chunk_start_offset=start, message_index_offsets=offsets))
        self._counts.update(dict.fromkeys(offsets, messages))

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
