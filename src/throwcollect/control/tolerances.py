"""Which tolerances are in force for a goal, and which joints break them.

A tolerance of 0 is not in force, here as in the parameters. Tolerances of velocities and accelerations never are, as in
controllers of ros2_controllers that command positions alone; a goal with an illegal one is still noticed.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.parameters import Constraints, to_nanoseconds
from throwcollect.control.values import JointTolerance, TrajectoryGoal

_ERASE = -1.0
"""A goal switches a tolerance off with this number (control_msgs); upstream compares with the width below."""
_ERASE_WIDTH = float(np.finfo(np.float32).eps)

Limits = NDArray[np.float64]
"""Largest position errors of the joints [rad], shape ``(n_joints,)``; 0 is not checked."""


@dataclass(frozen=True)
class Tolerances:
    """Tolerances in force.

    Attributes:
        path: Largest errors while moving.
        goal: Largest errors at the end.
        goal_time_ns: How late the end may be reached [ns]; 0 waits for ever.
    """

    path: Limits
    goal: Limits
    goal_time_ns: int


def default_tolerances(constraints: Constraints, joints: Sequence[str]) -> Tolerances:
    """Make the tolerances of trajectories that bring none of their own: the controller's parameters as arrays."""
    limits = [constraints.of(joint) for joint in joints]
    return Tolerances(
        path=np.array([limit.trajectory for limit in limits]),
        goal=np.array([limit.goal for limit in limits]),
        goal_time_ns=to_nanoseconds(constraints.goal_time),
    )


def goal_tolerances(
    goal: TrajectoryGoal, defaults: Tolerances, joints: Sequence[str], *, logger: logging.Logger
) -> Tolerances:
    """Find the tolerances of one goal: its own where it has any, the defaults elsewhere.

    One illegal number or unknown joint makes the whole goal fall back to the defaults; the log has the reason.
    """
    try:
        path = _merge(goal.path_tolerance, defaults.path, joints, "path_tolerance")
        end = _merge(goal.goal_tolerance, defaults.goal, joints, "goal_tolerance")
        goal_time_ns = _resolve_time(goal.goal_time_tolerance_ns, defaults.goal_time_ns)
    except ValueError as error:
        logger.error("%s Using default tolerances.", error)
        return defaults
    return Tolerances(path, end, goal_time_ns)


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
