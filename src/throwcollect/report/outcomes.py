"""Outcomes as a report shows them: in one order, each with a colour and a marker of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.tasks.result import LIMIT_VIOLATED, LOST, REFUSED, TRACKING_FAILED
from throwcollect.tasks.slide.slide_result import SlideOutcome
from throwcollect.tasks.throw.throw_result import ThrowOutcome
from throwcollect.tasks.throw_into.into_result import IntoOutcome


@dataclass(frozen=True)
class Style:
    """How an outcome is drawn.

    Attributes:
        colour: In hex; people who confuse red and green tell these colours apart, on white and on black.
        symbol: Marker, as plotly calls it.
    """

    colour: str
    symbol: str


LANDED = ThrowOutcome.LANDED.value

_STYLES = {
    LANDED: Style("#0072B2", "circle"),
    LIMIT_VIOLATED: Style("#E69F00", "diamond"),
    ThrowOutcome.SELF_HIT.value: Style("#D55E00", "x"),
    ThrowOutcome.RECAUGHT.value: Style("#CC79A7", "triangle-up"),
    ThrowOutcome.NOT_RELEASED.value: Style("#56B4E9", "square"),
    ThrowOutcome.DROPPED.value: Style("#8A63D2", "star-triangle-down"),
    ThrowOutcome.BODY_HIT.value: Style("#44AA99", "hourglass"),
    IntoOutcome.WALL_HIT.value: Style("#AA4499", "diamond-wide"),
    IntoOutcome.RIM_HIT.value: Style("#332288", "diamond-tall"),
    IntoOutcome.BOUNCED_OUT.value: Style("#CC6677", "bowtie"),
    IntoOutcome.SHORT.value: Style("#C4B04A", "triangle-left"),
    IntoOutcome.BEYOND.value: Style("#117733", "triangle-right"),
    SlideOutcome.MISSED_PUCK.value: Style("#56B4E9", "circle-open"),
    SlideOutcome.PUSHED_TWICE.value: Style("#CC79A7", "triangle-ne"),
    SlideOutcome.OFF_TABLE.value: Style("#8A63D2", "triangle-se"),
    SlideOutcome.ROBOT_HIT.value: Style("#D55E00", "x-thin-open"),
    ThrowOutcome.TIMEOUT.value: Style("#009E73", "triangle-down"),
    TRACKING_FAILED: Style("#999933", "cross"),
    LOST: Style("#7F7F7F", "hexagon"),
    REFUSED: Style("#B3B3B3", "star"),
}
_UNKNOWN = Style("#882255", "pentagon")
_VERBS = {
    LANDED: ("land", "landed"),
    IntoOutcome.IN_BIN.value: ("stay in the bin", "stayed in the bin"),
    SlideOutcome.AT_REST.value: ("come to rest on the table", "came to rest on the table"),
}
_SHARED = (LIMIT_VIOLATED, TRACKING_FAILED, LOST, REFUSED)
"""Failures of any task."""
_FAILURES = (_UNKNOWN, *(style for name, style in _STYLES.items() if name not in (LANDED, *_SHARED)))
"""Styles for failures that only tasks of other packages have; such a task has no failures of a throw."""


def style_of(outcome: str) -> Style:
    """How an outcome of a throw is drawn."""
    return _STYLES.get(outcome, _UNKNOWN)


def in_words(outcome: str) -> str:
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
    success: str = LANDED

    @classmethod
    def of(cls, outcomes: Iterable[str], *, success: str = LANDED) -> Outcomes:
        """Outcomes in the order of trials."""
        listed = list(outcomes)
        order = [success, *_STYLES]
        names = sorted(set(listed), key=lambda name: (order.index(name) if name in order else len(order), name))
        index = {name: code for code, name in enumerate(names)}
        return cls(tuple(names), np.array([index[name] for name in listed], dtype=np.intp), success)

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
        """How an outcome is drawn; the success of any task is drawn as a landing is."""
        if name == self.success:
            return style_of(LANDED)
        others = [each for each in self.names if each not in _STYLES and each != self.success]
        return _FAILURES[others.index(name) % len(_FAILURES)] if name in others else style_of(name)

    def are(self, name: str) -> NDArray[np.bool_]:
        """Which trials have an outcome, shape ``(n_trials,)``."""
        return np.array([each == name for each in self.names])[self.codes]
