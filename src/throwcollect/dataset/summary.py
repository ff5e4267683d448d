"""The summary of a dataset: light to import, as records of runs hold it, and most commands read those."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Info:
    """Summary of a dataset.

    Attributes:
        name: Name of the collection.
        trials: Number of planned trials.
        episodes: Number of trials with an episode.
        outcomes: Number of trials of each outcome, most frequent first.
        wanted: Number of trials that were to succeed; None if there was no such number.
        landing: Lowest and highest ``x_m`` and ``y_m`` at which a ball landed [m], in world; None if none did, or
            the task throws no ball.
        samples: Number of samples in all episodes.
        duration_s: Simulated time of all episodes together [s].
        shards: Number of MCAP files.
        size_bytes: Size of all files of the dataset.
        recordings_bytes: Size of the MCAP files.
        topics: Number of messages of each topic.
        digest: Hash over all episodes in order of trials, as it was written.
        wall_s: Real time for which it was collected, without pauses [s]; None if no journal tells.
        success: Outcome of trials that succeeded.
        noun: What a trial is called.
    """

    name: str
    trials: int
    episodes: int
    outcomes: Mapping[str, int]
    wanted: int | None
    landing: Mapping[str, tuple[float, float]] | None
    samples: int
    duration_s: float
    shards: int
    size_bytes: int
    recordings_bytes: int
    topics: Mapping[str, int]
    digest: str
    wall_s: float | None = None
    success: str = "landed"
    noun: str = "throw"

    def as_dict(self) -> dict[str, object]:
        """The same for JSON."""
        return asdict(self)
