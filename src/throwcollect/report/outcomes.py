"""Outcomes as a report shows them: in the order of the task, each with a colour and a marker of its own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.tasks.result import LIMIT_VIOLATED, LOST, REFUSED, TRACKING_FAILED


@dataclass(frozen=True)
class Style:
    """How an outcome is drawn.

    Attributes:
        colour: In hex; people who confuse red and green tell these colours apart, on white and on black.
        symbol: Marker, as plotly calls it.
    """

    colour: str
    symbol: str


SUCCESS = Style("#0072B2", "circle")
_SHARED = {
    LIMIT_VIOLATED: Style("#E69F00", "diamond"),
    TRACKING_FAILED: Style("#999933", "cross"),
    LOST: Style("#7F7F7F", "hexagon"),
    REFUSED: Style("#B3B3B3", "star"),
}
"""Failures of any task."""
_FAILURES = (
    Style("#56B4E9", "square"),
    Style("#8A63D2", "star-triangle-down"),
    Style("#CC79A7", "triangle-up"),
    Style("#D55E00", "x"),
    Style("#44AA99", "hourglass"),
    Style("#009E73", "triangle-down"),
    Style("#332288", "diamond-tall"),
    Style("#AA4499", "diamond-wide"),
    Style("#CC6677", "bowtie"),
    Style("#C4B04A", "triangle-left"),
    Style("#117733", "triangle-right"),
    Style("#882255", "pentagon"),
)
"""Styles of the other failures of a task, in its order."""
_VERBS = {
    "landed": ("land", "landed"),
    "in_bin": ("stay in the bin", "stayed in the bin"),
    "at_rest": ("come to rest on the table", "came to rest on the table"),
}


def in_words(outcome: str) -> str:
    """An outcome as people write it."""
    return outcome.replace("_", " ")


@dataclass(frozen=True)
class Outcomes:
    """The outcomes of all trials.

    Attributes:
        names: Outcomes that occur, in the same order in all reports, the success first.
        codes: Index into `names` of each trial, shape ``(n_trials,)``.
        declared: All outcomes of the task, the success first.
    """

    names: tuple[str, ...]
    codes: NDArray[np.intp]
    declared: tuple[str, ...]

    @classmethod
    def of(cls, outcomes: Iterable[str], declared: Sequence[str] = ("landed",)) -> Outcomes:
        """Outcomes in the order of trials, and those that the task has, the success first."""
        listed = list(outcomes)
        order = {name: place for place, name in enumerate(dict.fromkeys((*declared, *_SHARED)))}
        names = sorted(set(listed), key=lambda name: (order.get(name, len(order)), name))
        index = {name: code for code, name in enumerate(names)}
        return cls(tuple(names), np.array([index[name] for name in listed], dtype=np.intp), tuple(order))

    @property
    def success(self) -> str:
        """Outcome of a trial that succeeded."""
        return self.declared[0]

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
        return _VERBS.get(self.success, ("succeed", in_words(self.success)))

    def style_of(self, name: str) -> Style:
        """How an outcome is drawn."""
        if name == self.success:
            return SUCCESS
        known = dict.fromkeys((*self.declared, *self.names))
        failures = [each for each in known if each not in _SHARED and each != self.success]
        return _SHARED.get(name) or _FAILURES[failures.index(name) % len(_FAILURES)]

    def are(self, name: str) -> NDArray[np.bool_]:
        """Which trials have an outcome, shape ``(n_trials,)``."""
        return np.array([each == name for each in self.names])[self.codes]
