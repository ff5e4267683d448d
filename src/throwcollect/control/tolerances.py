"""Which tolerances are in force for a goal, and which joints break them.

A tolerance of 0 is not in force, here as in the parameters. Those of velocities take effect in controllers that command
velocities or efforts besides positions; those of accelerations never do, as accelerations are not measured. They are
checked for being legal all the same.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.goal import JointTolerance, TrajectoryGoal
from throwcollect.control.parameters import Constraints

_ERASE = -1.0
_ERASE_WIDTH = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Limits:
    """Largest errors of the joints; 0 is not checked.

    Attributes:
        position: [rad], shape ``(n_joints,)``.
        velocity: [rad/s], shape ``(n_joints,)``.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]

    @property
    def checked(self) -> bool:
        """Whether any error is checked."""
        return bool(self.position.any() or self.velocity.any())


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


def default_tolerances(constraints: Constraints, joints: Sequence[str], *, velocities: bool) -> Tolerances:
    """Tolerances of trajectories that bring none of their own.

    Args:
        constraints: Those of the controller.
        joints: Joints of the controller, in order.
        velocities: Whether there is a velocity error to be checked.

    Returns:
        The parameters as arrays.
    """
    limits = [constraints.of(joint) for joint in joints]
    stopped = constraints.stopped_velocity_tolerance if velocities else 0.0
    still = np.zeros(len(joints))
    return Tolerances(
        path=Limits(np.array([limit.trajectory for limit in limits]), still),
        goal=Limits(np.array([limit.goal for limit in limits]), np.full(len(joints), stopped)),
        goal_time_ns=round(constraints.goal_time * 1e9),
    )


def goal_tolerances(
    goal: TrajectoryGoal, defaults: Tolerances, joints: Sequence[str], *, velocities: bool, logger: logging.Logger
) -> Tolerances:
    """Tolerances of one goal: its own where it has any, the defaults elsewhere.

    One illegal number or unknown joint makes the whole goal fall back to the defaults; the log says so.

    Args:
        goal: The goal.
        defaults: Tolerances of the controller.
        joints: Joints of the controller, in order.
        velocities: Whether there is a velocity error to be checked.
        logger: Log of the controller.

    Returns:
        The tolerances to put in force.
    """
    try:
        path = _merged(goal.path_tolerance, defaults.path, joints, "path_tolerance")
        end = _merged(goal.goal_tolerance, defaults.goal, joints, "goal_tolerance")
        goal_time_ns = _resolved_time(goal.goal_time_tolerance_ns, defaults.goal_time_ns)
    except _IllegalToleranceError as error:
        logger.error("%s Using default tolerances.", error)
        return defaults
    if not velocities:
        path, end = (Limits(limits.position, np.zeros(len(joints))) for limits in (path, end))
    return Tolerances(path, end, goal_time_ns)


def violations(
    position: NDArray[np.float64], velocity: NDArray[np.float64] | None, limits: Limits, joints: Sequence[str]
) -> str:
    """Joints whose error is above their tolerance.

    Args:
        position: Position error [rad], shape ``(n_joints,)``.
        velocity: Velocity error [rad/s], shape ``(n_joints,)``; None if there is none.
        limits: Largest errors.
        joints: Names of the joints.

    Returns:
        One phrase for each error that is too large; empty if there is none.
    """
    phrases = _violations("position", "rad", position, limits.position, joints)
    if velocity is not None:
        phrases += _violations("velocity", "rad/s", velocity, limits.velocity, joints)
    return "; ".join(phrases)


def _violations(
    what: str, unit: str, error: NDArray[np.float64], tolerance: NDArray[np.float64], joints: Sequence[str]
) -> list[str]:
    broken = np.flatnonzero((tolerance > 0) & (np.abs(error) > tolerance))
    return [
        f"joint {joints[index]} has {what} {_compared(error[index], tolerance[index], unit)}"
        for index in broken.tolist()
    ]


def _compared(error: float, tolerance: float, unit: str) -> str:
    """An error that is above its tolerance, both with as many digits as it takes to see that."""
    digits = next((n for n in range(6, 17) if f"{abs(error):.{n}g}" != f"{tolerance:.{n}g}"), 17)
    return f"error {error:.{digits}g} {unit}, tolerance {tolerance:.{digits}g} {unit}"


class _IllegalToleranceError(Exception):
    """A goal's tolerance that has no meaning; never leaves this module."""


def _merged(asked: Sequence[JointTolerance], defaults: Limits, joints: Sequence[str], field: str) -> Limits:
    position, velocity = defaults.position.copy(), defaults.velocity.copy()
    for tolerance in asked:
        if tolerance.name not in joints:
            raise _IllegalToleranceError(f"joint '{tolerance.name}' specified in goal.{field} does not exist.")
        index = joints.index(tolerance.name)
        where = f"joint '{tolerance.name}' specified in goal.{field} has a invalid"
        position[index] = _resolved(tolerance.position, float(defaults.position[index]), f"{where} position tolerance")
        velocity[index] = _resolved(tolerance.velocity, float(defaults.velocity[index]), f"{where} velocity tolerance")
        _resolved(tolerance.acceleration, 0.0, f"{where} acceleration tolerance")
    return Limits(position, velocity)


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
        raise _IllegalToleranceError(f"{what}: {asked:g} (expected 0, -1 or more than 0).")
    return default
