"""Outcomes as a report shows them: in the order of the task, each with a colour and a marker of its own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.tasks.outcome_styles import LANDED, STYLES, Style, style_of

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
    def of(cls, outcomes: Iterable[str], declared: Sequence[str] = (LANDED,)) -> Outcomes:
        """Outcomes in the order of trials, and those that the task has, the success first."""
        listed = list(outcomes)
        order = {name: place for place, name in enumerate(dict.fromkeys((*declared, *STYLES)))}
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
        return style_of(name, self.success)

    def are(self, name: str) -> NDArray[np.bool_]:
        """Which trials have an outcome, shape ``(n_trials,)``."""
        return np.array([each == name for each in self.names])[self.codes]
