"""Why targets are out of reach, in words."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from throwcollect.learning.aiming import REACH, TOLERANCE, Aim
from throwcollect.learning.learned_map import KeyRole, LearnedMap
from throwcollect.learning.score import format_length


def explain_reach(learned: LearnedMap, aim: Aim) -> str:
    """Say why a target is out of reach and, unless predictions say nothing there, what comes nearest to it."""
    ends, given = np.split(aim.target, [len(learned.targets)])
    away, missed = (float(np.linalg.norm(place - ends)) for place in (aim.nearest, aim.predicted))
    outside = [
        f"{axis.key} was {axis.minimum:g} to {axis.maximum:g} in all throws"
        for axis, value in zip(learned.axes_of(KeyRole.CONTEXT), given.tolist(), strict=True)
        if not axis.minimum <= value <= axis.maximum
    ]
    if outside:
        # Far outside of what was collected, the polynomial gives any place at all.
        return f"{_join_numbers(aim.target)}; {'; '.join(outside)}"
    reasons = []
    if away > REACH:
        reasons.append(
            f"no throw came within {format_length(REACH, learned.targets)}, so predictions there are uncertain"
        )
    if missed > TOLERANCE:
        reasons.append(f"the best parameters are predicted to miss it by {format_length(missed, learned.targets)}")
    return (
        f"{_join_numbers(aim.target)}; {'; '.join(reasons)}\n"
        f"  the nearest throw ends at {_join_numbers(aim.nearest)} "
        f"({format_length(away, learned.targets)} away); predicted end: {_join_numbers(aim.predicted)}"
    )


def _join_numbers(values: Iterable[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
