"""Encodes the samples of a trial as the state chunk of its episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import zstandard
from mcap.opcode import Opcode

from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import MESSAGE_HEADER, RECORD_PREFIX_BYTES, Chunk
from throwcollect.episode.message_table import MessageTable
from throwcollect.episode.record import ControllerSamples, Samples
from throwcollect.episode.topics import Recording


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
