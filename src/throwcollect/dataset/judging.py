"""Judges episodes that are stored, or were simulated in this process, with the rules of the coordinator."""

from __future__ import annotations

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.members import explain_failure
from throwcollect.robots.description import robot_of
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of, trajectory_of


def judge_episode(config: Config, episode: Episode) -> Result:
    """Say how a trial with this configuration ended, from its episode."""
    samples = episode.samples(robot_of(config).joints)
    if (np.diff(samples.stamps_ns) <= 0).any():
        raise DatasetError("chunk: the stamps do not increase")
    with explain_failure("tasks", config.task.name, f"judge trial {episode.header.trial}"):
        result: Result = task_of(config).judge(samples, episode.header, trajectory_of(config))
    return result
