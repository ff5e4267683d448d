"""Finds the motion of the configuration that `throwcollect init` writes, for any robot and any task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from throwcollect.config.schema import Config
from throwcollect.config.task_config import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.members import load_member
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot
from throwcollect.tasks.task import trajectory_of

Motion = tuple[Mapping[str, float], Mapping[str, float], float]
"""Angles at the start and at the end, by joint [rad], and the time in between [s]."""

_STROKE_RAD = 0.4
"""How far each joint moves if its limits allow it [rad]."""
_LEAST_RAD = 0.02
"""A joint that may not move by this angle stays at rest [rad]."""
_SWEPT = 1.5
"""A joint that moves by 1 rad must be allowed to move by this angle [rad], because the end of one joint is swept."""
_MARGIN_RAD, _MARGIN_SHARE = 0.05, 0.05
"""Distance of commanded positions from their limits, because measured positions go a little further: the angle, or the
share of the range if that is less."""
_SPEED_SHARE = 0.95
"""Share of its velocity limit that a joint may use, for the same reason."""


def find_first_motion(robot: str, task: str) -> Motion:
    """Find a motion: the default of the task or, if that is for another robot, a short one from the posture at rest.

    The short motion keeps the limits of positions and velocities, even if a joint goes half as far again; neither
    torques nor collisions are looked at. Robot and task are given by their names.
    """
    try:
        found = _describe_motion(robot, task).task
    except ValidationError:
        found = _find_short_motion(robot, task)
    return found.start, found.end, found.duration_s


def _describe_motion(robot: str, task: str, **motion: Mapping[str, float]) -> Config:
    """Make the configuration of a motion; whatever is not given is the default of the task."""
    values = {"name": "throws", "robot": {"name": robot}, "task": {"name": task, **motion}}
    return Config.model_validate(values, context=robot)


def _find_short_motion(name: str, task: str) -> TaskConfig:
    """Find a motion of all joints that may move, each by `_STROKE_RAD`, or as far as its limits allow."""
    robot: Robot = load_member("robots", name)
    limits = joint_limits(robot)
    margin = np.minimum(_MARGIN_RAD, _MARGIN_SHARE * (limits.upper - limits.lower))
    lower, upper = limits.lower + margin, limits.upper - margin
    start = np.clip(list(robot.rest_posture.values()), lower, upper)
    above, below = upper - start, start - lower
    is_upward = (above >= _SWEPT * _STROKE_RAD) | (above >= below)
    room = np.minimum(
        np.where(is_upward, above, below), _SPEED_SHARE * limits.velocity / _find_speeds(name, robot.joints, task)
    )
    stroke = np.minimum(_STROKE_RAD, room / _SWEPT)
    end = np.round(start + np.where(is_upward, stroke, -stroke), 3)
    moving = [joint for joint, far in zip(robot.joints, stroke, strict=True) if far >= _LEAST_RAD]
    if not moving:
        raise ConfigError(
            f"{robot.urdf_path}: no joint of {robot.title} may move by {_LEAST_RAD:g} rad, by its limits of position "
            "and velocity"
        )
    angles = dict(zip(robot.joints, end.tolist(), strict=True))
    found = _describe_motion(
        name,
        task,
        start=dict(zip(robot.joints, np.round(start, 6).tolist(), strict=True)),
        end={joint: angles[joint] for joint in moving},
    )
    return found.task


def _find_speeds(robot: str, joints: Sequence[str], task: str) -> NDArray[np.float64]:
    """Find the highest speed of each joint per radian that it moves, in the default time of the task [1/s]."""
    start, end = dict.fromkeys(joints, 0.0), dict.fromkeys(joints, _STROKE_RAD)
    trajectory = trajectory_of(_describe_motion(robot, task, start=start, end=end))
    speeds: NDArray[np.float64] = np.abs(trajectory.velocities).max(axis=0) / _STROKE_RAD
    return speeds
