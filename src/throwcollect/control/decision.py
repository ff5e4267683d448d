"""What an update decides about the trajectory that is being followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.motion import Motion
from throwcollect.control.outcome import ErrorCode, GoalStatus
from throwcollect.control.tolerances import Tolerances, violations


@dataclass(frozen=True)
class Decision:
    """A trajectory is over.

    Attributes:
        status: Whether its end was reached or a tolerance broken.
        error_code: Which tolerance.
        text: In words; upstream's text comes first, as clients know it.
    """

    status: GoalStatus
    error_code: ErrorCode
    text: str


def decided(
    motion: Motion, measured: NDArray[np.float64], tolerances: Tolerances, joints: Sequence[str], *, first: bool
) -> Decision | None:
    """Judge one update.

    Args:
        motion: What is being followed.
        measured: Measured positions [rad], shape ``(n_joints,)``.
        tolerances: Those in force.
        joints: Names of the joints.
        first: Whether it is the motion's first update, in which the path is checked even if the end has come.

    Returns:
        The decision; None while the trajectory goes on, or its end waits for the joints.
    """
    if tolerances.checks_path and (first or not motion.past_end):
        broken = violations(motion.desired - measured, tolerances.path, joints)
        if broken:
            text = f"Aborted due to path tolerance violation: {broken}"
            return Decision(GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, text)
    if not motion.past_end:
        return None
    broken = violations(motion.desired - measured, tolerances.goal, joints) if tolerances.checks_goal else ""
    if not broken:
        return Decision(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, "Goal successfully reached!")
    late_ns = motion.since_end_ns
    if 0 < tolerances.goal_time_ns < late_ns:
        text = f"Aborted due to goal_time_tolerance exceeding by {late_ns / 1e9:f} seconds: {broken}"
        return Decision(GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, text)
    return None
