"""Columns of targets: a list of trials may say where each trial should end."""

from __future__ import annotations

from dataclasses import dataclass

TARGET_PREFIX = "target_"
"""Prefix of the columns of targets. No other columns have it: keys have dots, and results have other names."""

LARGEST_TARGET = 1e6
"""Largest number of a target [m, rad, ...]: no robot reaches that far, and powers of it do not overflow."""


@dataclass(frozen=True)
class TargetColumn:
    """A column of lists and tables that says where a trial should end; the trial itself does not depend on it.

    Attributes:
        name: Its name, which begins with `TARGET_PREFIX` and ends with its unit.
        of: The column of the task's results, or the key given with a target, that should have the value.
        miss: Column of the table of throws with the miss to which this column contributes.
        word: Its name in sentences.
        description: Its meaning, with the unit.
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
