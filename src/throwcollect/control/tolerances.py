"""Which tolerances are in force for a trajectory, and what they decide in each update.

A tolerance of 0 is not in force, here as in the parameters. Tolerances of velocities and accelerations never are, as in
controllers of ros2_controllers that command positions alone; a goal with an illegal one is still noticed.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.followed_curve import Motion
from throwcollect.control.parameters import ControllerParameters, to_nanoseconds
from throwcollect.control.values import ErrorCode, GoalResult, GoalStatus, JointState, JointTolerance, TrajectoryGoal

_ERASE = -1.0
"""A goal switches a tolerance off with this number (control_msgs); upstream compares with the width below."""
_ERASE_WIDTH = float(np.finfo(np.float32).eps)

Limits = NDArray[np.float64]
"""Largest position errors of the joints [rad], shape ``(n_joints,)``; 0 is not checked."""


@dataclass(frozen=True)
class Tolerances:
    """Tolerances in force, by which the updates of one trajectory are judged.

    Attributes:
        joints: Names of the joints.
        path: Largest errors while moving.
        goal: Largest errors at the end.
        goal_time_ns: How late the end may be reached [ns]; 0 waits for ever.
        timeout_ns: How long after the end the joints are stopped [ns]; 0 never.
    """

    joints: Sequence[str]
    path: Limits
    goal: Limits
    goal_time_ns: int
    timeout_ns: int

    @classmethod
    def of(cls, parameters: ControllerParameters) -> Tolerances:
        """Make the tolerances of trajectories that bring none of their own."""
        limits = [parameters.constraints.of(joint) for joint in parameters.joints]
        return cls(
            parameters.joints,
            np.array([limit.trajectory for limit in limits]),
            np.array([limit.goal for limit in limits]),
            to_nanoseconds(parameters.constraints.goal_time),
            parameters.timeout_ns,
        )

    def merge(self, goal: TrajectoryGoal, *, logger: logging.Logger) -> Tolerances:
        """Find the tolerances of one goal: its own where it has any, these elsewhere.

        One illegal number or unknown joint makes the whole goal fall back to these; the log has the reason.
        """
        try:
            path = _merge(goal.path_tolerance, self.path, self.joints, "path_tolerance")
            end = _merge(goal.goal_tolerance, self.goal, self.joints, "goal_tolerance")
            goal_time_ns = _resolve_time(goal.goal_time_tolerance_ns, self.goal_time_ns)
        except ValueError as error:
            logger.error("%s Using default tolerances.", error)
            return self
        return replace(self, path=path, goal=end, goal_time_ns=goal_time_ns)

    def decide(self, motion: Motion, measured: JointState, *, first: bool) -> GoalResult | None:
        """Judge one update; None while the trajectory goes on, or has ended but the joints are not there yet.

        In the `first` update of a motion, the path is checked even if the end has come.
        """
        past_end = motion.past_end
        if self.path.any() and (first or not past_end):
            broken = violations(motion.desired - measured.positions, self.path, self.joints)
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
        broken = violations(motion.desired - measured.positions, self.goal, self.joints) if self.goal.any() else ""
        if not broken:
            return GoalResult(GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, "Goal successfully reached!")
        if 0 < self.goal_time_ns < late_ns:
            text = f"Aborted due to goal_time_tolerance exceeding by {late_ns / 1e9:f} seconds: {broken}"
            return GoalResult(GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, text)
        return None

    def updates_to_skip(self, motion: Motion, *, goal: bool) -> int | None:
        """Count the updates that can pass without anything to decide; None if there will never be anything.

        `goal` is whether a goal waits for the end of the motion.
        """
        if self.path.any() and not motion.past_end:
            return 0
        if goal:
            return max(0, motion.updates_until_end())
        # Without a goal, nothing is decided when the end is reached, but only when one of these limits has passed.
        limits = [self.timeout_ns, self.goal_time_ns if self.goal.any() else 0]
        late = [motion.updates_until_late(limit_ns) for limit_ns in limits if limit_ns]
        return max(0, min(late)) if late else None

    def is_settled(self, motion: Motion) -> bool:
        """Whether an end that no goal waits for has been judged for the last time."""
        return bool(self.goal.any()) and not self.timeout_ns and 0 < self.goal_time_ns < motion.since_end_ns


def violations(error: NDArray[np.float64], limits: Limits, joints: Sequence[str]) -> str:
    """Write one phrase for each joint whose position error [rad], shape ``(n_joints,)``, is above its limit."""
    broken = np.flatnonzero((limits > 0) & (np.abs(error) > limits))
    return "; ".join(
        f"joint {joints[index]} has position {_describe(error[index], limits[index])}" for index in broken.tolist()
    )


def _describe(error: float, tolerance: float) -> str:
    """Write an error and the tolerance below it with as many digits as it takes to see which is larger."""
    # Six digits are what `%g` writes, and 17 tell any two numbers of double precision apart.
    digits = next((n for n in range(6, 17) if f"{abs(error):.{n}g}" != f"{tolerance:.{n}g}"), 17)
    return f"error {error:.{digits}g} rad, tolerance {tolerance:.{digits}g} rad"


def _merge(asked: Sequence[JointTolerance], defaults: Limits, joints: Sequence[str], field: str) -> Limits:
    limits = defaults.copy()
    for tolerance in asked:
        if tolerance.name not in joints:
            raise ValueError(f"joint '{tolerance.name}' specified in goal.{field} does not exist.")
        index = joints.index(tolerance.name)
        where = f"joint '{tolerance.name}' specified in goal.{field} has a invalid"
        limits[index] = _resolve(tolerance.position, float(defaults[index]), f"{where} position tolerance")
        _resolve(tolerance.velocity, 0.0, f"{where} velocity tolerance")
        _resolve(tolerance.acceleration, 0.0, f"{where} acceleration tolerance")
    return limits


def _resolve_time(asked_ns: int, default_ns: int) -> int:
    if not asked_ns:
        return default_ns
    return round(_resolve(asked_ns / 1e9, 0.0, "Specified illegal goal_time_tolerance") * 1e9)


def _resolve(asked: float, default: float, what: str) -> float:
    if asked > 0:
        return asked
    if abs(asked - _ERASE) < _ERASE_WIDTH:
        return 0.0
    if asked < 0:
        raise ValueError(f"{what}: {asked:g} (expected 0, -1 or more than 0).")
    return default
