"""Writes the configuration with which `throwcollect init` lets users begin: a few keys, and comments on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from throwcollect.config.loader import value_as_yaml
from throwcollect.config.robot_config import RobotConfig
from throwcollect.config.schema import Config
from throwcollect.config.shape import root
from throwcollect.config.task_config import TaskConfig
from throwcollect.errors import ConfigError
from throwcollect.extras import has_wheel
from throwcollect.members import load_member, names_of
from throwcollect.robots.importing import find_robot
from throwcollect.robots.robot import Robot, joint_limits
from throwcollect.wording import find_near, suggest

_NARROW_RAD = 0.2
"""The last angle of a joint is swept by this angle to either side, but by no more than half of the joint's motion."""
_STROKE_RAD = 0.4
"""How far a joint moves if its limits allow it [rad]."""
_MARGIN = 0.05
"""Distance of a start from the limits of its joint, over its range, as measured positions go a little further."""


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


def check_task(name: str) -> None:
    """Reject the name of a task that does not exist, or cannot be loaded."""
    if name not in (known := names_of("tasks")):
        how = "" if find_near(name, known) else "; docs/robots.md describes how to add one"
        raise ConfigError(f"--task {name}: no such task is installed{suggest(name, known)}{how}")
    load_member("tasks", name)


def begin_at_default(robot: str, task: str) -> Beginning | None:
    """Find the default motion of a task with a robot; None if the default is for another robot and the task throws.

    Where a task without throws has no motion for the robot, one joint moves.
    """
    section = load_member("tasks", task)
    if "landing" in section.events and robot != RobotConfig().name:
        return None
    values = {"name": "throws", "robot": {"name": robot}, "tool": {"name": section.tool}, "task": {"name": task}}
    try:
        found = Config.model_validate(values).task
        start, end, duration_s = found.start, found.end, found.duration_s
    except ValidationError:
        duration_s = section.model_fields["duration_s"].default
        start, end = _move_one_joint(find_robot(robot), duration_s)
    joint = max(end, key=lambda name: abs(end[name] - start[name]))
    half_rad = min(_NARROW_RAD, abs(end[joint] - start[joint]) / 2)
    ranges = {
        f"task.end.{joint}": (round(end[joint] - half_rad, 3), round(end[joint] + half_rad, 3)),
        "task.duration_s": (duration_s, round(1.3 * duration_s, 3)),
    }
    return Beginning([f"name: {robot} # {_list_choices(names_of('robots'))}"], start, end, duration_s, ranges)


def _move_one_joint(robot: Robot, duration_s: float) -> tuple[dict[str, float], dict[str, float]]:
    """Find start and end of a motion of the joint with the most room: to half of its way to a limit, and not fast."""
    limits = joint_limits(robot)
    margin = _MARGIN * (limits.upper - limits.lower)
    start = np.clip(list(robot.rest_posture.values()), limits.lower + margin, limits.upper - margin)
    above, below = limits.upper - start, start - limits.lower
    room = np.minimum(np.maximum(above, below) / 2, limits.velocity * duration_s / 4)
    column = int(np.argmax(room))
    stroke = min(_STROKE_RAD, float(room[column]))
    end = float(start[column]) + (stroke if above[column] >= below[column] else -stroke)
    return dict(zip(robot.joints, start.round(6).tolist(), strict=True)), {robot.joints[column]: round(end, 3)}


def write_starter(task: str, beginning: Beginning) -> str:
    """Write the text of a configuration to begin with, for the task of this name."""
    return "".join(f"{line}\n" for line in _write_lines(task, beginning))


def _write_lines(task: str, beginning: Beginning) -> Iterator[str]:
    start, end, duration_s, ranges = beginning.start, beginning.end, beginning.duration_s, beginning.ranges
    yield "# What is collected. Angles are in radians, times in seconds; docs/configuration.md lists every key, and"
    yield "# `throwcollect config` prints all of them. `throwcollect plan` lists trials that the robot cannot do."
    yield "name: throws # of the dataset: datasets/throws"
    yield "trials: 200"
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
    yield f"  sampler: sobol # {_list_choices(root().child('sweep').child('sampler').choices)}"
    yield "  parameters:"
    yield from (f"    {key}: {{min: {low:g}, max: {high:g}}}" for key, (low, high) in ranges.items())


def _write_own_keys(section: type[TaskConfig]) -> Iterator[str]:
    """Write the keys that only this task has, with their defaults, and what they mean."""
    for key, node in section.model_json_schema()["properties"].items():
        if key not in TaskConfig.model_fields and "default" in node:
            meaning = node.get("description", "").partition("\n\n")[0].replace("\n", " ").rstrip(".")
            yield f"{key}: {value_as_yaml(node['default'])}{f' # {meaning}' if meaning else ''}"


def _list_choices(names: Iterable[str]) -> str:
    return f"one of {', '.join(names)}"
