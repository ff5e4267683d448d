"""What figures are drawn from: outcomes, numbers of tables and of a journal, summarised, and a choice of points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Range
from throwcollect.config.shape import unit_of_key
from throwcollect.config.values import keys_by_column
from throwcollect.dataset.journal import JournalLine
from throwcollect.tasks.outcome_styles import LANDED, STYLES, Style, style_of

MOST_POINTS = 5000
"""Points in one plot."""


_VERBS = {
    "landed": ("land", "landed"),
    "in_bin": ("stay in the bin", "stayed in the bin"),
    "at_rest": ("come to rest on the table", "came to rest on the table"),
}


def describe(outcome: str) -> str:
    """An outcome as people write it."""
    return outcome.replace("_", " ")


@dataclass(frozen=True)
class Outcomes:
    """The outcomes of all trials.

    Attributes:
        names: Outcomes that occur, in the same order in all reports, the success first.
        codes: Index into `names` of each trial, shape ``(n_trials,)``.
        success: Outcome of a trial that succeeded.
    """

    names: tuple[str, ...]
    codes: NDArray[np.intp]
    success: str

    @classmethod
    def of(cls, outcomes: Iterable[str], declared: Sequence[str] = (LANDED,)) -> Outcomes:
        """Outcomes in the order of trials, and those that the task has, the success first."""
        listed = list(outcomes)
        order = {name: place for place, name in enumerate(dict.fromkeys((*declared, *STYLES)))}
        names = sorted(set(listed), key=lambda name: (order.get(name, len(order)), name))
        index = {name: code for code, name in enumerate(names)}
        return cls(tuple(names), np.array([index[name] for name in listed], dtype=np.intp), declared[0])

    @property
    def counts(self) -> dict[str, int]:
        """Number of trials of each outcome."""
        return dict(zip(self.names, np.bincount(self.codes, minlength=len(self.names)).tolist(), strict=True))

    @property
    def succeeded(self) -> int:
        """Number of trials that succeeded."""
        return self.counts.get(self.success, 0)

    @property
    def verbs(self) -> tuple[str, str]:
        """What a trial that succeeds does, and what one that succeeded did."""
        return _VERBS.get(self.success, ("succeed", describe(self.success)))

    def style_of(self, name: str) -> Style:
        """How an outcome is drawn."""
        return style_of(name, self.success)

    def are(self, name: str) -> NDArray[np.bool_]:
        """Which trials have an outcome, shape ``(n_trials,)``."""
        return np.array([each == name for each in self.names])[self.codes]


def read_numbers(throws: pa.Table, name: str) -> NDArray[np.float64]:
    """Read a column of numbers, nan for nulls, shape ``(n_trials,)``."""
    return np.asarray(throws[name].to_numpy(), dtype=np.float64)


def choose_points(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Choose indices of points to draw, in order: all, or `most` of them, always the same random choice."""
    if count <= most:
        return np.arange(count)
    # Every n-th point of a Sobol sequence or a grid lies on a lattice, which would look like a pattern in the data.
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))


_BINS = 12


@dataclass(frozen=True)
class SweptKey:
    """One swept key.

    Attributes:
        key: Dotted key.
        unit: Unit of its values; empty if they have none.
        logarithmic: True if its logarithm, and not its value, was drawn evenly.
        values: Value of each trial, shape ``(n_trials,)``.
        edges: Edges of the bins, shape ``(n_bins + 1,)``.
        counts: Trials in each bin by outcome, shape ``(n_bins, n_outcomes)``.
    """

    key: str
    unit: str
    logarithmic: bool
    values: NDArray[np.float64]
    edges: NDArray[np.float64]
    counts: NDArray[np.intp]


def read_parameters(config: Config, throws: pa.Table, outcomes: Outcomes) -> tuple[SweptKey, ...]:
    """Read all swept keys of a table of throws, in its order."""
    columns = keys_by_column(config, throws.column_names)
    return tuple(_read_parameter(config, key, read_numbers(throws, name), outcomes) for name, key in columns.items())


def _read_parameter(config: Config, key: str, values: NDArray[np.float64], outcomes: Outcomes) -> SweptKey:
    swept = config.sweep.parameters.get(key)
    logarithmic = isinstance(swept, Range) and swept.scale == "log"
    edges = np.histogram_bin_edges(np.log(values) if logarithmic else values, _BINS)
    edges = np.exp(edges) if logarithmic else edges
    # Rounding must not leave out the smallest and the largest value.
    edges[[0, -1]] = min(edges[0], values.min()), max(edges[-1], values.max())
    counts = [np.histogram(values[outcomes.are(name)], edges)[0] for name in outcomes.names]
    return SweptKey(key, unit_of_key(key), logarithmic, values, edges, np.stack(counts, axis=1))


KINDS = ("position", "velocity", "effort")


def summarise_peaks(throws: pa.Table, kind: str) -> dict[str, NDArray[np.float64]]:
    """Find the peaks of one of `KINDS`, divided by their limit [-], by the joint that came closest to its limit.

    Each joint has an array with a number for each of these trials; the joint with the largest peak comes first.
    """
    shares = read_numbers(throws, f"{kind}_peak_share")
    joints = np.array(throws[f"{kind}_peak_joint"].to_pylist(), dtype=object)
    measured = np.isfinite(shares)
    peaks = {joint: shares[measured & (joints == joint)] for joint in sorted({str(name) for name in joints[measured]})}
    return dict(sorted(peaks.items(), key=lambda each: -each[1].max()))


def measure_times(events: Iterable[JournalLine]) -> tuple[dict[str, list[float]], float]:
    """Find when trials came in (``commit``), and when the journal was ``opened``, without pauses.

    Returns:
        The times of these entries of a journal, which are in order, since the first one [s]; and that of the last one.
    """
    times: dict[str, list[float]] = {"commit": [], "opened": []}
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
    return times, elapsed
