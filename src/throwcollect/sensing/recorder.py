"""Renders what the sensors of a configuration see of recorded samples, as chunks of messages."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import zstandard

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_table import MOST_FRAMES_BYTES, MessageTable, make_row
from throwcollect.episode.record import Samples
from throwcollect.episode.topics import put_stamps
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import make_sensor
from throwcollect.units import NS_PER_S

_LEVEL = 6
"""Level of zstd: takes 2 % of the time of rendering; with -1, a frame does not fit into its window."""


class SensorRecorder:
    """Renders the frames of the sensors of one configuration.

    Args:
        channels: The channels of the configuration.
        on_frame: Called after each frame, as all frames of a trial may take many seconds.
    """

    def __init__(self, channels: Channels, on_frame: Callable[[], None] = lambda: None) -> None:
        self._on_frame = on_frame
        self._topics = channels.sensors
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)

    def record(self, config: Config, trial: int, samples: Samples) -> tuple[Chunk, ...]:
        """Render all frames of a trial: its configuration, its number, and its samples as they are recorded.

        Returns:
            Chunks of at most 4 MiB with their message indexes, sensor by sensor in the order of names.
        """
        if not self._topics:
            return ()
        scene, chunks = Scene.of(config), []
        for name, topics in self._topics.items():
            sensor = make_sensor(name, config, scene, trial)
            numbers = np.arange(0, len(samples), config.record.rate_hz // sensor.rate_hz)
            row = make_row({number: topic.layout for number, topic in topics.items()})
            most = max(MOST_FRAMES_BYTES // len(row), 1)
            for first in range(0, len(numbers), most):
                stamps = samples.stamps_ns[numbers[first : first + most]]
                table = MessageTable(row * len(stamps), len(stamps))
                arrived = stamps + round(sensor.latency_s * NS_PER_S)
                rows = {}
                for number, topic in topics.items():
                    headers = table.headers(number)
                    headers["sequence"] = np.arange(first, first + len(stamps))
                    headers["log_time"], headers["publish_time"] = arrived, stamps
                    rows[topic.stream] = table.messages(number).view(topic.layout.dtype)[:, 0]
                    put_stamps(rows[topic.stream], topic.stamp, stamps)
                for place in range(len(stamps)):
                    seen = sensor.look(scene.place_sample(samples, int(numbers[first + place])), first + place)
                    for stream, messages in rows.items():
                        for field, values in seen[stream].items():
                            messages[field][place] = values
                    self._on_frame()
                chunks.append(table.compress(self._compressor, arrived))
        return tuple(chunks)
