"""Writes the configuration with which `throwcollect init` lets users begin: a few keys, and comments on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.config.loader import value_as_yaml
from throwcollect.config.robot_config import RobotConfig
from throwcollect.config.schema import Config
from throwcollect.config.shape import root
from throwcollect.config.task_config import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.extras import has_wheel
from throwcollect.members import load_member, names_of
from throwcollect.robots.importing import find_robot
from throwcollect.robots.robot import joint_limits
from throwcollect.tasks.task import trajectory_of
from throwcollect.wording import find_near, suggest

POINTS = "throws.csv"
"""The list of points that the sampler `list` reads, in the directory of the configuration."""

_NARROW_RAD = 0.2
"""The last angle of a joint is swept by this angle to either side, but by no more than half of the joint's motion."""

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


def samplers() -> list[str]:
    """List the names of all samplers."""
    return root().child("sweep").child("sampler").choices


@dataclass(frozen=True)
class Beginning:
    """What a configuration begins with.

    Attributes:
        robot: Lines of its section `robot`, without the key.
        start: Angle of each joint at the start [rad].
        end: Angle at the end of the joints that move [rad].
        duration_s: Time in between.
        ranges: Least and greatest value of the keys to sweep.
    """

    robot: Sequence[str]
    start: Mapping[str, float]
    end: Mapping[str, float]
    duration_s: float
    ranges: Mapping[str, tuple[float, float]]


def make_starter(task: str, sampler: str, beginning: Beginning) -> dict[str, str]:
    """Write a configuration to begin with, for the task and the sampler of these names.

    Returns:
        The text of the configuration as ``throwcollect.yaml``, and of `POINTS` if the sampler reads it.
    """
    ranges = beginning.ranges
    texts = {str(DEFAULT_CONFIG): "".join(f"{line}\n" for line in _write_lines(task, sampler, beginning))}
    if sampler == "list":
        rows = zip(*((low, (low + high) / 2, high) for low, high in ranges.values()), strict=True)
        texts[POINTS] = "\n".join([",".join(ranges), *(",".join(f"{value:g}" for value in row) for row in rows), ""])
    return texts


def check_choices(task: str, sampler: str) -> None:
    """Reject names of a task and a sampler that do not exist, and a task that cannot be loaded."""
    for option, name, known in (("--task", task, names_of("tasks")), ("--sampler", sampler, samplers())):
        if name not in known:
            how = "" if option == "--sampler" or find_near(name, known) else "; docs/robots.md describes how to add one"
            raise ConfigError(f"{option} {name}: no such {option[2:]} is installed{suggest(name, known)}{how}")
    load_member("tasks", task)


def begin_at_default(robot: str, task: str) -> Beginning | None:
    """Find the default motion of a task with a robot; None if the default is for another robot and the task throws."""
    if "landing" in load_member("tasks", task).events and robot != RobotConfig().name:
        return None
    try:
        found = _describe_motion(robot, task).task
    except ValidationError:
        found = _find_short_motion(robot, task)
    end, start, duration_s = found.end, found.start, found.duration_s
    joint = max(end, key=lambda name: abs(end[name] - start[name]))
    half_rad = min(_NARROW_RAD, abs(end[joint] - start[joint]) / 2)
    ranges = {
        f"task.end.{joint}": (round(end[joint] - half_rad, 3), round(end[joint] + half_rad, 3)),
        "task.duration_s": (duration_s, round(1.3 * duration_s, 3)),
    }
    return Beginning([f"name: {robot} # {_list_choices(names_of('robots'))}"], start, end, duration_s, ranges)


def _write_lines(task: str, sampler: str, beginning: Beginning) -> Iterator[str]:
    start, end, duration_s, ranges = beginning.start, beginning.end, beginning.duration_s, beginning.ranges
    yield "# What is collected. Angles are in radians, times in seconds; docs/configuration.md lists every key, and"
    yield "# `throwcollect config` prints all of them. `throwcollect plan` lists trials that the robot cannot do."
    yield "name: throws # of the dataset: datasets/throws"
    yield f"trials: {'3' if sampler == 'list' else '200'}"
    yield "seed: 1 # everything that is random follows from it"
    yield ""
    yield "robot:"
    yield from (f"  {line}" for line in beginning.robot)
    if (tool := load_member("tasks", task).tool) != Config().tool.name:
        yield "tool:"
        yield f"  name: {tool} # {_list_choices(names_of('tools'))}"
    yield "task:"
    yield f"  name: {task} # {_list_choices(names_of('tasks'))}"
    yield f"  duration_s: {duration_s:g} # how long the motion takes"
    yield f"  start: {value_as_yaml(dict(start))}"
    yield f"  end: {value_as_yaml(dict(end))} # the joints that move"
    yield from (f"  {line}" for line in _write_own_keys(load_member("tasks", task)))
    if not has_wheel("pybullet"):
        yield "sim:"
        yield "  engine: mujoco # bullet, the default, has no wheel for this Python"
    yield ""
    yield "sweep: # what varies from trial to trial: any number of any section, by its dotted key"
    yield f"  sampler: {sampler} # {_list_choices(samplers())}"
    if sampler == "list":
        yield f"  file: {POINTS} # one row a trial, one column a key"
        return
    yield "  parameters:"
    count = ", count: 20" if sampler == "grid" else ""
    for number, (key, (low, high)) in enumerate(ranges.items()):
        yield f"    {key}: {{min: {low:g}, max: {high:g}{', count: 10' if count and number else count}}}"


def _write_own_keys(section: type[TaskConfig]) -> Iterator[str]:
    """Write the keys that only this task has, with their defaults, and what they mean."""
    for key, node in section.model_json_schema()["properties"].items():
        if key not in TaskConfig.model_fields and "default" in node:
            meaning = node.get("description", "").partition("\n\n")[0].replace("\n", " ").rstrip(".")
            yield f"{key}: {value_as_yaml(node['default'])}{f' # {meaning}' if meaning else ''}"


def _list_choices(names: Iterable[str]) -> str:
    return f"one of {', '.join(names)}"


def _describe_motion(robot: str, task: str, **motion: Mapping[str, float]) -> Config:
    """Make the configuration of a motion; whatever is not given is the default of the task."""
    tool = load_member("tasks", task).tool
    values = {"name": "throws", "robot": {"name": robot}, "tool": {"name": tool}, "task": {"name": task, **motion}}
    return Config.model_validate(values)


def _find_short_motion(name: str, task: str) -> TaskConfig:
    """Find a motion of all joints that may move, each by `_STROKE_RAD`, or as far as its limits allow."""
    robot = find_robot(name)
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
