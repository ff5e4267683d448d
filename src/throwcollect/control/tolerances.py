"""Which tolerances are in force for a goal, and which joints break them.

A tolerance of 0 is not in force, here as in the parameters. A controller that commands positions alone has no velocity
or acceleration error, so only position tolerances can take effect; the others are still checked for being legal.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.goal import JointTolerance, TrajectoryGoal
from throwcollect.control.parameters import Constraints, JointConstraints

_LOGGER = logging.getLogger(__name__)
_ERASE = -1.0
_ERASE_WIDTH = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Tolerances:
    """Tolerances in force.

    Attributes:
        path: Largest position error while moving [rad], shape ``(n_joints,)``; 0 is not checked.
        goal: Largest position error at the end [rad], shape ``(n_joints,)``; 0 is not checked.
        goal_time_ns: How late the end may be reached [ns]; 0 waits for ever.
    """

    path: NDArray[np.float64]
    goal: NDArray[np.float64]
    goal_time_ns: int

    @property
    def checks_path(self) -> bool:
        """Whether any joint is checked while moving."""
        return bool(self.path.any())

    @property
    def checks_goal(self) -> bool:
        """Whether any joint is checked at the end."""
        return bool(self.goal.any())


def default_tolerances(constraints: Constraints, joints: Sequence[str]) -> Tolerances:
    """Tolerances of trajectories that bring none of their own.

    Args:
        constraints: Those of the controller.
        joints: Joints of the controller, in order.

    Returns:
        The parameters as arrays.
    """
    limits = [constraints.joints.get(joint, JointConstraints()) for joint in joints]
    return Tolerances(
        path=np.array([limit.trajectory for limit in limits]),
        goal=np.array([limit.goal for limit in limits]),
        goal_time_ns=round(constraints.goal_time * 1e9),
    )


def goal_tolerances(goal: TrajectoryGoal, defaults: Tolerances, joints: Sequence[str], controller: str) -> Tolerances:
    """Tolerances of one goal: its own where it has any, the defaults elsewhere.

    One illegal number or unknown joint makes the whole goal fall back to the defaults; the log says so.

    Args:
        goal: The goal.
        defaults: Tolerances of the controller.
        joints: Joints of the controller, in order.
        controller: Name of the controller, for the log.

    Returns:
        The tolerances to put in force.
    """
    try:
        return Tolerances(
            path=_merged(goal.path_tolerance, defaults.path, joints, "path_tolerance"),
            goal=_merged(goal.goal_tolerance, defaults.goal, joints, "goal_tolerance"),
            goal_time_ns=_resolved_time(goal.goal_time_tolerance_ns, defaults.goal_time_ns),
        )
    except _IllegalToleranceError as error:
        _LOGGER.error("%s: %s Using default tolerances.", controller, error)
        return defaults


def violations(error: NDArray[np.float64], tolerance: NDArray[np.float64], joints: Sequence[str]) -> str:
    """Joints whose error is above their tolerance.

    Args:
        error: Position error [rad], shape ``(n_joints,)``.
        tolerance: Largest position error [rad], shape ``(n_joints,)``; 0 is not checked.
        joints: Names of the joints.

    Returns:
        One phrase for each such joint with error and tolerance; empty if there is none.
    """
    broken = np.flatnonzero((tolerance > 0) & (np.abs(error) > tolerance))
    return "; ".join(
        f"joint {joints[index]} has position error {error[index]:f} rad, tolerance {tolerance[index]:f} rad"
        for index in broken.tolist()
    )


class _IllegalToleranceError(Exception):
    """A goal's tolerance that has no meaning; never leaves this module."""


def _merged(
    asked: Sequence[JointTolerance], defaults: NDArray[np.float64], joints: Sequence[str], field: str
) -> NDArray[np.float64]:
    merged = defaults.copy()
    for tolerance in asked:
        if tolerance.name not in joints:
            raise _IllegalToleranceError(f"joint '{tolerance.name}' specified in goal.{field} does not exist.")
        index = joints.index(tolerance.name)
        where = f"joint '{tolerance.name}' specified in goal.{field}"
        merged[index] = _resolved(
            tolerance.position, float(defaults[index]), f"{where} has a invalid position tolerance"
        )
        _resolved(tolerance.velocity, 0.0, f"{where} has a invalid velocity tolerance")
        _resolved(tolerance.acceleration, 0.0, f"{where} has a invalid acceleration tolerance")
    return merged


def _resolved_time(asked_ns: int, default_ns: int) -> int:
    if not asked_ns:
        return default_ns
    return round(_resolved(asked_ns / 1e9, 0.0, "Specified illegal goal_time_tolerance") * 1e9)


def _resolved(asked: float, default: float, what: str) -> float:
    if asked > 0:
        return asked
    if abs(asked - _ERASE) < _ERASE_WIDTH:
        return 0.0
    if asked < 0:
        raise _IllegalToleranceError(f"{what}: {asked:f} (expected 0, -1 or more than 0).")
    return default
