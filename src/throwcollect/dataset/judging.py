"""Judges episodes that are stored, or were simulated in this process, as the coordinator does."""

from __future__ import annotations

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.message import Episode
from throwcollect.errors import DatasetError
from throwcollect.robots.description import robot_of
from throwcollect.tasks.throw.judge import judge
from throwcollect.tasks.throw.outcome import ThrowResult
from throwcollect.tasks.trajectory import throw_trajectory


def judge_episode(config: Config, episode: Episode) -> ThrowResult:
    """What came of a trial.

    Args:
        config: Configuration of the trial.
        episode: Its episode.

    Raises:
        DatasetError: If the episode is damaged, or another robot's.
    """
    samples = episode.samples(robot_of(config).joints)
    if (np.diff(samples.stamps_ns) <= 0).any():
        raise DatasetError("chunk: the stamps do not increase")
    return judge(
        samples,
        episode.header,
        config=config,
        trajectory=throw_trajectory(config),
    )
