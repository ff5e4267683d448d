"""Checks what a task of another package declares and returns, so that its mistakes are found where they are made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.result import Outcome, Result
from throwcollect.tasks.result_columns import Column

_LARGEST_COUNT = 2**63
"""Tables hold whole numbers of 64 bits, so no count may be as large as this."""
_TYPES: Mapping[str, tuple[type, ...]] = {"number": (int, float), "count": (int,), "text": (str,)}
_WORDS = {"number": "a number", "count": "a whole number", "text": "a text"}


def check_declared(outcomes: object, results: object) -> None:
    """Make sure that outcomes and results of a task are classes of the right kind.

    Raises:
        TypeError: If one of them is not.
    """
    for name, found, kind in (("outcomes", outcomes, Outcome), ("results", results, Result)):
        if not (isinstance(found, type) and issubclass(found, kind)):
            raise TypeError(f"{name} should be a class derived from {kind.__module__}.{kind.__name__}, is {found!r}")


def check_trajectory(trajectory: object, joints: Sequence[str]) -> None:
    """Make sure that a planned motion is one of these joints, of finite numbers, which begins at time 0.

    Raises:
        TypeError: If it is no trajectory.
        ValueError: If its joints, its shapes or its numbers are wrong.
    """
    if not isinstance(trajectory, JointTrajectory):
        raise TypeError(f"trajectory should return a JointTrajectory, returned {trajectory!r}")
    if tuple(trajectory.joints) != tuple(joints):
        wanted, found = ", ".join(joints), ", ".join(map(str, trajectory.joints))
        raise ValueError(f"the joints of the trajectory should be those of task.end, {wanted}, are {found}")
    points = len(trajectory.times)
    parts: dict[str, tuple[int, ...]] = {"times": (points,)}
    parts |= dict.fromkeys(("positions", "velocities", "accelerations"), (points, len(joints)))
    for name, shape in parts.items():
        values = getattr(trajectory, name)
        if np.shape(values) != shape:
            raise ValueError(f"{name} of the trajectory should have the shape {shape}, have {np.shape(values)}")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} of the trajectory hold numbers that are not finite")
    if points < 1 or trajectory.times[0] != 0 or (np.diff(trajectory.times) <= 0).any():
        raise ValueError("times of the trajectory should begin at 0 and increase")


def check_assessment(returned: object, results: type[Result], outcomes: type[Outcome], failure: type) -> None:
    """Make sure that `Task.assess` returned a result, and a failure with an outcome of the task or None.

    Raises:
        TypeError: If it returned anything else.
    """
    wanted = f"assess should return a {results.__name__} and a {failure.__name__} or None"
    if not (isinstance(returned, tuple) and len(returned) == 2):
        raise TypeError(f"{wanted}, returned {_describe(returned)}")
    result, found = returned
    if not (isinstance(result, results) and (found is None or isinstance(found, failure))):
        raise TypeError(f"{wanted}, returned {_describe(result)} and {_describe(found)}")
    if found is None:
        return
    outcome, reason = (getattr(found, name) for name in ("outcome", "reason"))
    if not isinstance(outcome, outcomes):
        raise TypeError(f"the outcome of a failure should be a {outcomes.__name__}, is {outcome!r}")
    if not isinstance(reason, str):
        raise TypeError(f"the reason of a failure should be a text, is {reason!r}")


def check_values(values: Mapping[str, Any], columns: Sequence[Column]) -> None:
    """Make sure that the values of a result are of the kinds of their columns; None is left out of the check.

    Raises:
        TypeError: If a value is of another kind.
        ValueError: If a number is not finite, or too large for a table.
    """
    for column in columns:
        name, value = column.name, values[column.name]
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, _TYPES[column.kind]):
            raise TypeError(f"{name} should be {_WORDS[column.kind]} of Python or None, is {_describe(value)}")
        if isinstance(value, int) and column.kind == "count" and not -_LARGEST_COUNT <= value < _LARGEST_COUNT:
            raise ValueError(f"{name} should be a whole number of 64 bits, is {value}")
        if isinstance(value, int | float) and column.kind == "number" and not math.isfinite(value):
            raise ValueError(f"{name} should be a finite number, or None if there is nothing to measure; is {value}")


def _describe(value: object) -> str:
    """Describe a value by its type, and by itself if that is short."""
    if value is None:
        return "None"
    text = repr(value)
    most = 40
    return f"{text} ({type(value).__name__})" if len(text) <= most else f"a {type(value).__name__}"
