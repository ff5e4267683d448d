"""Judges episodes that are stored, or were simulated in this process, with the rules of the coordinator."""

from __future__ import annotations

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.message import Episode
from throwcollect.errors import DatasetError
from throwcollect.robots.description import robot_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of


def judge_episode(config: Config, episode: Episode, trajectory: JointTrajectory | None = None) -> Result:
    """Say how a trial ended, from its episode.

    Args:
        config: Configuration of the trial.
        episode: Its episode.
        trajectory: The joint trajectory that its controllers were sent; None to compute it here.

    Raises:
        DatasetError: If the episode is damaged, or another robot's.
    """
    samples = episode.samples(robot_of(config).joints)
    if (np.diff(samples.stamps_ns) <= 0).any():
        raise DatasetError("chunk: the stamps do not increase")
    task = task_of(config)
    if trajectory is None:
        trajectory = task.trajectory()
    result: Result = task.judge(samples, episode.header, trajectory)
    return result
