"""The summary of a dataset, without what computes it, so that commands that only read records of runs start fast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from throwcollect.errors import LossError
from throwcollect.tasks.result import LOST
from throwcollect.units import format_distance
from throwcollect.wording import format_count


@dataclass(frozen=True)
class MissSummary:
    """By how much trials missed their targets, in the unit of the column of misses.

    Attributes:
        targets: Number of trials with such a target.
        measured: Number of those that ended somewhere; without any, all that follows is None.
        share90: The miss that nine of ten trials stay below.
    """

    targets: int
    measured: int
    median: float | None
    share90: float | None
    largest: float | None

    def format_misses(self, unit: str) -> tuple[str, str, str]:
        """Write median, share90 and largest miss for people; `unit` is that of the column."""
        median, share90, largest = (format_distance(each, unit) for each in (self.median, self.share90, self.largest))
        return median, share90, largest


@dataclass(frozen=True)
class Info:
    """Summary of a dataset: its name, how many trials were planned, how many of them have an episode, and more.

    Attributes:
        outcomes: Number of trials of each outcome, most frequent first.
        wanted: Number of trials that were to succeed; None if there was no such number.
        landing: Lowest and highest ``x_m`` and ``y_m`` at which objects ended in trials that succeeded [m], in world;
            None if none did, or the task has no such place.
        samples: Number of samples in all episodes.
        duration_s: Simulated time of all episodes together [s].
        shards: Number of MCAP files.
        recordings_bytes: Size of these files; `size_bytes` is the size of all files.
        topics: Number of messages of each topic.
        digest: Hash over all episodes in order of trials, and their targets, as it was written.
        wall_s: Real time for which it was collected, without pauses [s]; None if no journal has it.
        success: Outcome of trials that succeeded.
        noun: What a trial is called.
        end: Name of the instant of `landing`; empty if the task has none.
        misses: By how much targets were missed, by column such as ``miss_m``; empty if trials have no targets.
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
    end: str = "landing"
    misses: Mapping[str, MissSummary] = field(default_factory=dict)


def explain_loss(outcomes: Mapping[str, int], *, hint: str | None) -> LossError | None:
    """Make the error for a finished dataset with lost trials, with this hint; None if none is lost."""
    lost, all_of_them = outcomes.get(LOST, 0), sum(outcomes.values())
    if not lost:
        return None
    verb = "is" if lost == 1 else "are"
    return LossError(
        f"{lost} of {format_count(all_of_them, 'trial')} {verb} lost; throws.parquet has the reasons", hint=hint
    )
