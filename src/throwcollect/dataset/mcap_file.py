"""One MCAP file of a dataset, written record by record.

The file starts with all schemas and channels and a chunk with the latched messages. Each episode is one uninterrupted
run of records: its chunk, the chunk's message indexes, and a Metadata record named `EPISODE` that says what it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import zstandard
from isal.isal_zlib import crc32
from mcap import records

from throwcollect.dataset.bag import FileSummary, bag_information, to_yaml
from throwcollect.dataset.manifest import FileEntry, RunningHash
from throwcollect.dataset.mcap_contents import FileContents, declarations
from throwcollect.episode.channels import Channel, Channels
from throwcollect.episode.chunk import Chunk, encode_records
from throwcollect.episode.message import Episode

MAGIC = b"\x89MCAP0\r\n"
EPISODE = "throwcollect.episode"
"""Name of the Metadata record that ends the run of an episode."""
BAG = "rosbag2"
"""Name of the Metadata record in which rosbag2 looks for a copy of the bag's metadata."""
PROFILE = "ros2"
LIBRARY = "throwcollect"

_LATCHED_LEVEL = 9


@dataclass(frozen=True)
class EpisodeRun:
    """The records of one episode as they lie in a file, wherever that is.

    Attributes:
        data: The bytes.
        chunk_index: Index of its chunk as if the run began at offset 0.
        metadata_length: Size of the Metadata record at its end [bytes].
        messages: Number of messages on each channel.
    """

    data: bytes
    chunk_index: records.ChunkIndex
    metadata_length: int
    messages: int

    @property
    def length(self) -> int:
        """Size of the records [bytes]."""
        return self.chunk_index.chunk_length + self.chunk_index.message_index_length + self.metadata_length


def episode_run(episode: Episode) -> EpisodeRun:
    """Records of an episode.

    Raises:
        DatasetError: If the episode's chunk is damaged.
    """
    indexes = {channel: episode.table.message_index(channel) for channel in episode.table.columns}
    facts = {
        "trial": str(episode.header.trial),
        "digest": episode.digest,
        "records_sha256": episode.records_sha256,
        "header": episode.header_json,
    }
    metadata = encode_records(records.Metadata(name=EPISODE, metadata=facts))
    return _run(episode.chunk, indexes, metadata, episode.header.samples)


def _run(chunk: Chunk, indexes: Mapping[int, bytes], metadata: bytes, messages: int) -> EpisodeRun:
    data = b"".join((chunk.record_header(), chunk.data, *indexes.values(), metadata))
    return EpisodeRun(data, episode_index(chunk, indexes), len(metadata), messages)


def episode_index(chunk: Chunk, indexes: Mapping[int, bytes]) -> records.ChunkIndex:
    """Index of a chunk as if it began at offset 0.

    Args:
        chunk: The chunk.
        indexes: Message Index records that follow it, by channel.
    """
    length = chunk.record_size
    offsets, offset = {}, length
    for channel, index in indexes.items():
        offsets[channel] = offset
        offset += len(index)
    return records.ChunkIndex(
        chunk_length=length,
        chunk_start_offset=0,
        compression="zstd",
        compressed_size=len(chunk.data),
        message_end_time=chunk.end_ns,
        message_index_length=offset - length,
        message_index_offsets=offsets,
        message_start_time=chunk.start_ns,
        uncompressed_size=chunk.uncompressed_size,
    )


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
        self._hash = RunningHash()
        self._channels = channels
        self._contents = FileContents(*declarations(channels.all))
        opening = encode_records(records.Header(PROFILE, LIBRARY), *self._contents.schemas, *self._contents.channels)
        self._put(MAGIC + opening)
        self.append(latched_run(channels, start_ns))

    def append(self, run: EpisodeRun) -> None:
        """Write an episode's run of records."""
        start = self.size
        self._put(run.data)
        self._contents.add_chunk(run.chunk_index, start, run.messages)
        if run.metadata_length:
            self._contents.add_metadata(EPISODE, self.size - run.metadata_length, run.metadata_length)

    def finish(self, name: str) -> FileSummary:
        """Write everything that follows the last episode.

        Args:
            name: Name of the file, for the copy of the bag's metadata that rosbag2 looks for in each file.

        Returns:
            What the bag's metadata say of the file.
        """
        summary = self._contents.summary(name)
        bag = encode_records(bag_record(summary, self._channels.all))
        self._contents.add_metadata(BAG, self.size, len(bag))
        self._put(bag)
        self._put(encode_records(records.DataEnd(self._crc)))
        self._put(self._contents.section(self.size) + MAGIC)
        return summary

    def entry(self, name: str) -> FileEntry:
        """What the manifest says of the file.

        Args:
            name: Name of the file.
        """
        return FileEntry(name, self.size, self._hash.hexdigest())

    def _put(self, data: bytes) -> None:
        self._write(data)
        self._crc = crc32(data, self._crc)
        self._hash.update(data)
        self.size += len(data)


def bag_record(summary: FileSummary, channels: Sequence[Channel]) -> records.Metadata:
    """The bag's metadata as rosbag2 keeps them in each file, as if the file were the whole bag."""
    return records.Metadata(BAG, {"serialized_metadata": to_yaml(bag_information([summary], channels, {}))})


def latched_run(channels: Channels, stamp_ns: int) -> EpisodeRun:
    """Records with the latched messages: a chunk and its message indexes."""
    messages = [
        encode_records(records.Message(channel.id, stamp_ns, data, stamp_ns, 0))
        for channel, data in channels.latched_messages(stamp_ns).items()
    ]
    indexes, offset = {}, 0
    for channel, message in zip(channels.latched, messages, strict=True):
        indexes[channel.id] = encode_records(records.MessageIndex(channel.id, [(stamp_ns, offset)]))
        offset += len(message)
    contents = b"".join(messages)
    data = zstandard.ZstdCompressor(level=_LATCHED_LEVEL).compress(contents)
    return _run(Chunk(data, len(contents), crc32(contents), stamp_ns, stamp_ns), indexes, b"", 1)
