"""One MCAP file of a dataset, written record by record.

The file starts with all schemas and channels and a chunk with the latched messages. Each episode is one uninterrupted
run of records: its chunks, each with its message indexes, and a Metadata record named `EPISODE` that says what it is.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records

from throwcollect.dataset.bag import FileSummary, bag_information, to_yaml
from throwcollect.dataset.mcap_contents import FileContents, Run, declarations
from throwcollect.episode.channels import Channel, Channels
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
    """Records of an episode.

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
        self._contents = FileContents(*declarations(channels.all))
        opening = encode_records(records.Header(PROFILE, LIBRARY), *self._contents.schemas, *self._contents.channels)
        self._put(MAGIC + opening)
        latched = encode_latched_run(channels, start_ns)
        self._contents.add_run(latched, self.size)
        self._put(latched.data)

    def append(self, run: Run) -> None:
        """Write an episode's run of records."""
        self._contents.add_run(run, self.size, EPISODE)
        self._put(run.data)

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

    def _put(self, data: bytes) -> None:
        self._write(data)
        self._crc = crc32(data, self._crc)
        self.size += len(data)


def bag_record(summary: FileSummary, channels: Sequence[Channel]) -> records.Metadata:
    """The bag's metadata as rosbag2 keeps them in each file, as if the file were the whole bag."""
    return records.Metadata(BAG, {"serialized_metadata": to_yaml(bag_information([summary], channels, {}))})


def encode_latched_run(channels: Channels, stamp_ns: int) -> Run:
    """Records with the latched messages: a chunk and its message indexes."""
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
