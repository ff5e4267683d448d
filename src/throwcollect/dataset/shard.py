"""One shard while it is filled: episodes in order of arrival, and at the end the same in order of trials.

While a shard is filled it is called ``<name>_00000.mcap.part``: a complete MCAP file but for its summary and footer, in
which every episode is one run of records. When its last trial is in, the runs are copied in order of trials into the
file ``<name>_00000.mcap``, and the other vanishes.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.files import replacing, unwritable, write_all
from throwcollect.dataset.mcap_file import EpisodeRun, McapFile, episode_run
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode


@dataclass(frozen=True)
class FinishedShard:
    """A shard in trial order under its final name.

    Attributes:
        summary: What the bag's metadata say of it.
        offsets: Where the chunk of each trial's episode begins [bytes].
    """

    summary: FileSummary
    offsets: Mapping[int, int]


class OpenShard:
    """A shard that still waits for episodes.

    Attributes:
        missing: Trials that have neither an episode nor are known to be lost.

    Args:
        path: Final path of the shard.
        trials: Trials whose episodes or losses it waits for.
        channels: What is recorded.
    """

    def __init__(self, path: Path, trials: Collection[int], channels: Channels) -> None:
        self.missing = set(trials)
        self._path = path
        self._part = path.with_name(f"{path.name}.part")
        self._channels = channels
        self._descriptor: int | None = None
        self._file: McapFile | None = None
        self._runs: dict[int, tuple[int, EpisodeRun]] = {}

    def append(self, episode: Episode) -> None:
        """Write an episode; when it fails, the file is as it was before.

        Raises:
            DatasetError: If the episode's chunk is damaged, or the file cannot be written.
        """
        run = episode_run(episode)
        start = self._file.size if self._file else 0
        try:
            if self._descriptor is None:
                self._descriptor = os.open(self._part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            if self._file is None:
                self._file = McapFile(self._write, self._channels, start_ns=episode.chunk.start_ns)
            offset = self._file.size
            self._file.append(run)
        except OSError as error:
            if self._descriptor is not None:
                with suppress(OSError):
                    os.ftruncate(self._descriptor, start)
                    os.lseek(self._descriptor, start, os.SEEK_SET)
            raise unwritable(self._part, error) from error
        # The bytes are in the file now; keeping them in memory too would hold whole shards there.
        self._runs[episode.header.trial] = (offset, replace(run, data=b""))
        self.missing.discard(episode.header.trial)

    def finish(self) -> FinishedShard | None:
        """Write the shard in trial order and remove what it was copied from.

        Returns:
            The finished shard; None when no trial of it has an episode.

        Raises:
            DatasetError: If the shard cannot be written.
        """
        if self._descriptor is None or not self._runs:
            return None
        offsets = {}
        first = min(self._runs)
        with replacing(self._path) as descriptor:
            file = McapFile(
                lambda data: write_all(descriptor, data),
                self._channels,
                start_ns=self._runs[first][1].chunk_index.message_start_time,
            )
            for trial in sorted(self._runs):
                offset, run = self._runs[trial]
                offsets[trial] = file.size
                index = run.chunk_index
                length = index.chunk_length + index.message_index_length + run.metadata_length
                file.append(replace(run, data=os.pread(self._descriptor, length, offset)))
            summary = file.finish(self._path.name)
        self.close()
        try:
            self._part.unlink()
        except OSError as error:
            raise unwritable(self._part, error) from error
        return FinishedShard(summary, offsets)

    def close(self) -> None:
        """Close the file; it stays where it is."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _write(self, data: bytes) -> None:
        if self._descriptor is None:
            raise ValueError("the shard is closed")
        write_all(self._descriptor, data)
