"""Targets of trials: what a list of trials may want of each of them, beside what it sets."""

from __future__ import annotations

from dataclasses import dataclass

TARGET_PREFIX = "target_"
"""Names of columns of targets begin with it, and no others: keys have dots, and results are named otherwise."""


@dataclass(frozen=True)
class TargetColumn:
    """A column of lists and tables that says where a trial should end; the trial itself does not depend on it.

    Attributes:
        name: Its name, which begins with `TARGET_PREFIX` and ends with its unit.
        of: What it is wanted of: a column of the task's results, or a key that is given with a target.
        miss: Column of the table of throws with the distance that it counts in.
        word: What it is called in a sentence.
        description: What it is, with its unit.
        required: Whether a target has to have it.
    """

    name: str
    of: str
    miss: str
    word: str
    description: str
    required: bool = False


def is_target(column: str) -> bool:
    """Whether a column of a list or a table is one of targets."""
    return column.startswith(TARGET_PREFIX) and "." not in column
