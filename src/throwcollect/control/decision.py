"""Decides in every update whether the trajectory that is being followed is over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from throwcollect.control.followed_curve import Motion
from throwcollect.control.tolerances import Limits, Tolerances, violations
from throwcollect.control.values import ErrorCode, GoalResult, GoalStatus, JointState


@dataclass(frozen=True)
class Judge:
    """Judges the updates of one trajectory.

    Attributes:
        tolerances: The tolerances in force.
        timeout_ns: How long after the end the joints are stopped [ns]; 0 never.
        joints: Names of the joints.
    """

    tolerances: Tolerances
    timeout_ns: int
    joints: Sequence[str]

    def decide(self, motion: Motion, measured: JointState, *, first: bool) -> GoalResult | None:
        """Judge one update; None while the trajectory goes on, or has ended but the joints are not there yet.

        In the `first` update of a motion, the path is checked even if the end has come.
        """
        past_end = motion.past_end
        if self.tolerances.path.any() and (first or not past_end):
            broken = self._find_violations(motion, measured, self.tolerances.path)
            if broken:
                text = f"Aborted due to path tolerance violation: {broken}"
                return GoalResult(GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, text)
        if not past_end:
            return None
        # As ros2_controllers do: a timeout of 0, and a tolerance of time of 0, mean that there is none.
        # The timeout comes before the goal, because joints that are stopped are no success (upstream reports one).
        late_ns = motion.since_end_ns
        if 0 < self.timeout_ns < late_ns:
            text = f"Aborted due to command timeout: {late_ns / 1e9:f} seconds after the end"
            return GoalResult(GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, text)
        goal = self.tolerances.goal
        broken = self._find_violations(motion, measured, goal) if goal.any() else ""
        if not broken:
            return GoalResult(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, "Goal successfully reached!")
        if 0 < self.tolerances.goal_time_ns < late_ns:
            text = f"Aborted due to goal_time_tolerance exceeding by {late_ns / 1e9:f} seconds: {broken}"
            return GoalResult(GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, text)
        return None

    def updates_to_skip(self, motion: Motion, *, goal: bool) -> int | None:
        """Count the updates that can pass without anything to decide; None if there will never be anything.

        `goal` is whether a goal waits for the end of the motion.
        """
        tolerances = self.tolerances
        if tolerances.path.any() and not motion.past_end:
            return 0
        if goal:
            return max(0, motion.updates_until_end())
        # Without a goal, nothing is decided when the end is reached, but only when one of these limits has passed.
        limits = [self.timeout_ns, tolerances.goal_time_ns if tolerances.goal.any() else 0]
        late = [motion.updates_until_late(limit_ns) for limit_ns in limits if limit_ns]
        return max(0, min(late)) if late else None

    def is_settled(self, motion: Motion) -> bool:
        """Whether an end that no goal waits for has been judged for the last time."""
        tolerances = self.tolerances
        waits = bool(tolerances.goal.any()) and not self.timeout_ns
        return waits and 0 < tolerances.goal_time_ns < motion.since_end_ns

    def _find_violations(self, motion: Motion, measured: JointState, limits: Limits) -> str:
        return violations(motion.desired - measured.positions, limits, self.joints)
