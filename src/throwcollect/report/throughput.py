"""How fast a dataset was collected, from its journal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_BINS = 40
_TROUBLES = ("fail", "lost")


@dataclass(frozen=True)
class Throughput:
    """Throws brought home over the time in which somebody collected; pauses between are left out.

    Attributes:
        edges_s: Of the intervals, since the first event [s], shape ``(n + 1,)``.
        rate_per_s: Throws per second in each interval, shape ``(n,)``.
        commits: Throws in all.
        resumed_s: When another process went on [s].
        troubles: When a simulation did not bring a trial back (``fail``) and when none did (``lost``) [s].
    """

    edges_s: NDArray[np.float64]
    rate_per_s: NDArray[np.float64]
    commits: int
    resumed_s: tuple[float, ...]
    troubles: Mapping[str, tuple[float, ...]]


def throughput(events: Iterable[Mapping[str, Any]]) -> Throughput | None:
    """Throughput over time.

    Args:
        events: Entries of a journal, in order, each with `event` and `time` [s].

    Returns:
        None if no episode came in, or all at one instant.
    """
    times: dict[str, list[float]] = {"commit": [], "opened": [], **{kind: [] for kind in _TROUBLES}}
    elapsed = 0.0
    last: float | None = None
    for event in events:
        if last is not None and event["event"] != "opened":
            # Clocks are set back now and then.
            elapsed += max(event["time"] - last, 0.0)
        last = event["time"]
        if event["event"] in times:
            times[event["event"]].append(elapsed)
    if not times["commit"] or elapsed <= 0:
        return None
    edges = np.linspace(0, elapsed, min(_BINS, max(len(times["commit"]) // 5, 1)) + 1)
    counts = np.histogram(times["commit"], edges)[0]
    return Throughput(
        edges_s=edges,
        rate_per_s=counts / np.diff(edges),
        commits=len(times["commit"]),
        resumed_s=tuple(times["opened"][1:]),
        troubles={kind: tuple(times[kind]) for kind in _TROUBLES},
    )
