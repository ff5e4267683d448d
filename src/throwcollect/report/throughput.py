"""How fast a dataset was collected, from its journal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.journal import JournalLine

_BINS = 40


@dataclass(frozen=True)
class Throughput:
    """Episodes that came in over the time of collecting, without pauses. All times are since the first event.

    Attributes:
        edges_s: Edges of intervals of time [s], shape ``(n + 1,)``.
        rate_per_s: Episodes per second in each interval, shape ``(n,)``.
        commits: Number of episodes.
        resumed_s: Times at which the collection was resumed [s].
        failed_s: Times at which a simulation failed to return a trial [s].
        lost_s: Times at which a trial was given up [s].
    """

    edges_s: NDArray[np.float64]
    rate_per_s: NDArray[np.float64]
    commits: int
    resumed_s: tuple[float, ...]
    failed_s: tuple[float, ...]
    lost_s: tuple[float, ...]


def measure_throughput(events: Iterable[JournalLine]) -> Throughput | None:
    """Measure throughput from the entries of a journal, in order; None if no episode came in, or all at one time."""
    times: dict[str, list[float]] = {kind: [] for kind in ("commit", "opened", "fail", "lost")}
    elapsed = 0.0
    last: float | None = None
    for event in events:
        # The time before an entry `opened` does not count, because nothing is collected before a run opens the journal.
        if last is not None and event.event != "opened":
            # If the clock was set back between two entries, no time counts between them.
            elapsed += max(event.time_s - last, 0.0)
        last = event.time_s
        if event.event in times:
            times[event.event].append(elapsed)
    commits = times["commit"]
    if not commits or elapsed <= 0:
        return None
    edges = np.linspace(0, elapsed, min(_BINS, max(len(commits) // 5, 1)) + 1)
    return Throughput(
        edges_s=edges,
        rate_per_s=np.histogram(commits, edges)[0] / np.diff(edges),
        commits=len(commits),
        # The first opening began the collection; each later one resumed it.
        resumed_s=tuple(times["opened"][1:]),
        failed_s=tuple(times["fail"]),
        lost_s=tuple(times["lost"]),
    )
