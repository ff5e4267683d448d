"""Gives an episode another trial number and moves it into that trial's slot of time.

Nothing in an episode but its stamps depends on its slot, so the result has the same bytes as a recording in that slot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import zstandard

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import MessageList, MessageTable
from throwcollect.episode.record import EpisodeHeader
from throwcollect.episode.recorded_chunk import RecordedChunk
from throwcollect.episode.topics import put_stamps, read_stamps
from throwcollect.errors import DatasetError


class Restamper:
    """Gives episodes of one configuration other numbers; threads may share a restamper."""

    def __init__(self, config: Config, channels: Channels) -> None:
        self._config = config
        self._topics = {channel.id: topic for channel, topic in channels.recorded.items()}

    def restamp(self, episode: Episode, trial: int) -> Episode:
        """Make the episode that trial `trial` of the configuration would have yielded."""
        # The copy gets a hash of its own, which would make damage look as if it had been recorded.
        episode.check_records()
        by_ns = self._config.trial_start_ns(trial) - episode.header.start_ns
        contents = bytearray(episode.state.contents)
        table = MessageTable(contents, episode.header.samples)
        self._move(table, by_ns)
        state = self._pack(contents, episode.state.chunk, by_ns)
        sensors = (self._move_sensor(sensor, by_ns) for sensor in episode.sensors)
        moved = Episode(_move_header(episode.header, trial, by_ns), state, *sensors)
        # The table is at hand, so the new chunk need not be decompressed for it.
        moved.table = table
        return moved

    def _move_sensor(self, sensor: RecordedChunk, by_ns: int) -> RecordedChunk:
        contents = bytearray(sensor.contents)
        MessageList(contents).move(by_ns)
        return self._pack(contents, sensor.chunk, by_ns)

    def _pack(self, contents: bytearray, like: Chunk, by_ns: int) -> RecordedChunk:
        """Make the chunk of records that are `by_ns` later than the records of the chunk `like`."""
        data = zstandard.compress(contents, self._config.record.zstd_level)
        return RecordedChunk.of(contents, data, start_ns=like.start_ns + by_ns, end_ns=like.end_ns + by_ns)

    def _move(self, table: MessageTable, by_ns: int) -> None:
        if list(table.columns) != list(self._topics):
            raise DatasetError(f"chunk: has the channels {list(table.columns)}", expected=f"{list(self._topics)}")
        for channel, topic in self._topics.items():
            messages = table.messages(channel)
            if not topic.layout.describes_message(messages[0].tobytes()):
                raise DatasetError(f"chunk: messages of {topic.name} are not laid out as {topic.type_name} is here")
            headers = table.headers(channel)
            for time in ("log_time", "publish_time"):
                # Times are unsigned, and the way to an earlier slot is negative.
                headers[time] = headers[time].astype(np.int64) + by_ns
            rows = messages.view(topic.layout.dtype)[:, 0]
            for stamp in topic.stamps:
                put_stamps(rows, stamp, read_stamps(rows, stamp) + by_ns)


def _move_header(header: EpisodeHeader, trial: int, by_ns: int) -> EpisodeHeader:
    contacts = tuple(
        replace(
            contact,
            start_ns=contact.start_ns + by_ns,
            end_ns=None if contact.end_ns is None else contact.end_ns + by_ns,
        )
        for contact in header.contacts
    )
    return replace(header, trial=trial, start_ns=header.start_ns + by_ns, contacts=contacts)
