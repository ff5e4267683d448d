"""One MCAP file of a dataset, written record by record.

The file starts with all schemas and channels and a chunk with the latched messages. Each episode is one uninterrupted
run of records: its chunks, each with its message indexes, and a Metadata record named `EPISODE` that says what it is.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from throwcollect.dataset.bag import FileSummary, bag_information, to_yaml
from throwcollect.dataset.mcap_records import Run, declarations
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk, encode_message_index, encode_records
from throwcollect.episode.message import Episode

MAGIC = b"\x89MCAP0\r\n"
EPISODE = "throwcollect.episode"
"""Name of the Metadata record that ends the run of an episode."""
SENSORS_SHA256 = "sensors_sha256"
"""Key of that record under which the hashes of the chunks of sensors stand, if there are any."""
BAG = "rosbag2"
"""Name of the Metadata record in which rosbag2 looks for a copy of the bag's metadata."""
PROFILE = "ros2"
LIBRARY = "throwcollect"

_LATCHED_LEVEL = 9


def episode_run(episode: Episode) -> Run:
    """Encode the records of an episode.

    Raises:
        DatasetError: If a chunk of the episode is damaged.
    """
    table = episode.table
    chunks = [(episode.chunk, {channel: table.message_index(channel) for channel in table.columns})]
    for sensor in episode.sensors:
        messages = sensor.messages
        chunks.append((sensor.chunk, {channel: messages.message_index(channel) for channel in messages.channels}))
    facts = {
        "trial": str(episode.header.trial),
        "digest": episode.digest,
        "records_sha256": episode.state.records_sha256,
        "header": episode.header_json,
    }
    if episode.sensors:
        facts[SENSORS_SHA256] = " ".join(sensor.records_sha256 for sensor in episode.sensors)
    return Run.of(chunks, encode_records(records.Metadata(name=EPISODE, metadata=facts)))


class McapFile:
    """Writes one file from its beginning.

    Attributes:
        size: Bytes written so far.

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

    def append(self, run: Run) -> None:
        """Write a run of records, such as that of an episode."""
        for index in run.chunk_indexes:
            offsets = {channel: self.size + offset for channel, offset in index.message_index_offsets.items()}
            start = self.size + index.chunk_start_offset
            self._chunk_indexes.append(replace(index, chunk_start_offset=start, message_index_offsets=offsets))
        self._counts.update(run.counts)
        if run.metadata_length:
            start = self.size + run.length - run.metadata_length
            self._metadata_indexes.append(records.MetadataIndex(start, run.metadata_length, EPISODE))
        self._put(run.data)

    def finish(self, name: str) -> FileSummary:
        """Write everything that follows the last episode.

        Args:
            name: Name of the file, for the copy of the bag's metadata that rosbag2 looks for in each file.

        Returns:
            What the bag's metadata say of the file.
        """
        start_ns = min(index.message_start_time for index in self._chunk_indexes)
        end_ns = max(index.message_end_time for index in self._chunk_indexes)
        summary = FileSummary(name, start_ns, end_ns, dict(sorted(self._counts.items())))
        # rosbag2 reads its metadata from each file, too, as if that were the whole bag.
        metadata = {"serialized_metadata": to_yaml(bag_information([summary], self._channels.all, {}))}
        bag = encode_records(records.Metadata(BAG, metadata))
        self._metadata_indexes.append(records.MetadataIndex(self.size, len(bag), BAG))
        self._put(bag)
        self._put(encode_records(records.DataEnd(self._crc)))
        self._put(self._encode_summary_section(summary) + MAGIC)
        return summary

    def _encode_summary_section(self, summary: FileSummary) -> bytes:
        """Everything between the end of the data and the closing magic (MCAP specification, Summary Section)."""
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
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, self.size, offset)
        crc = zlib.crc32(footer, zlib.crc32(contents))
        return contents + encode_records(records.Footer(self.size, offset, crc))

    def _put(self, data: bytes) -> None:
        self._write(data)
        self._crc = crc32(data, self._crc)
        self.size += len(data)


def encode_latched_run(channels: Channels, stamp_ns: int) -> Run:
    """Encode the latched messages: a chunk and its message indexes."""
    messages = [
        encode_records(records.Message(channel.id, stamp_ns, data, stamp_ns, 0))
        for channel, data in channels.encode_latched_messages(stamp_ns).items()
    ]
    starts = itertools.accumulate(map(len, messages), initial=0)
    indexes = {
        channel.id: encode_message_index(channel.id, np.array([stamp_ns], np.uint64), np.array([start]))
        for channel, start in zip(channels.latched, starts, strict=False)
    }
    contents = b"".join(messages)
    data = zstandard.ZstdCompressor(level=_LATCHED_LEVEL).compress(contents)
    return Run.of([(Chunk.of(contents, data, start_ns=stamp_ns, end_ns=stamp_ns), indexes)])
