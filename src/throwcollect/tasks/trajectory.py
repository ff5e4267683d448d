"""From the parameters of a throw to the joint trajectory that the controllers are sent."""

from __future__ import annotations

from throwcollect.config.motion import MinimumJerk
from throwcollect.config.schema import Config
from throwcollect.robots.description import robot_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.dmp import dmp_trajectory
from throwcollect.tasks.minimum_jerk import minimum_jerk_trajectory


def throw_trajectory(config: Config) -> JointTrajectory:
    """Joint trajectory of a throw.

    Args:
        config: Configuration of one trial.

    Returns:
        Points over the joints of `task.end`, in the order of `Robot.joints`; the first one is at time 0 and at
        `task.start`, the last one at rest and exactly at `task.end`.

    Raises:
        ConfigError: If the trajectory family has no usable motion for these parameters: a DMP that does not settle.
    """
    task = config.task
    end = {joint: task.end[joint] for joint in robot_of(config).joints if joint in task.end}
    family = task.trajectory
    if isinstance(family, MinimumJerk):
        return minimum_jerk_trajectory(
            task.start, end, duration_s=task.duration_s, family=family, points_hz=task.points_hz
        )
    return dmp_trajectory(task.start, end, duration_s=task.duration_s, family=family, points_hz=task.points_hz)
