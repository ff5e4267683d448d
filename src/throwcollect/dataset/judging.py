"""Judges the episodes of a plan's trials as the coordinator does."""

from __future__ import annotations

import numpy as np

from throwcollect.episode.message import Episode
from throwcollect.errors import DatasetError
from throwcollect.robots.model import joint_limits
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.throw import ThrowResult, judge
from throwcollect.tasks.trajectory import throw_trajectory


def judged(plan: Plan, episode: Episode) -> ThrowResult:
    """What came of a trial.

    Args:
        plan: The plan that has the trial.
        episode: Its episode.

    Raises:
        DatasetError: If the episode is damaged.
    """
    config = plan.config_of(plan.trials[episode.header.trial])
    samples = episode.samples()
    if (np.diff(samples.stamps_ns) <= 0).any():
        raise DatasetError("chunk: the stamps do not increase")
    return judge(
        samples,
        episode.header,
        config=config,
        trajectory=throw_trajectory(config),
        limits=joint_limits(),
    )
