"""Chooses motions of a file for the trials of a plan, with the values that follow from them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from throwcollect.config.motion import MotionFile
from throwcollect.config.schema import Config
from throwcollect.plan.trials import Points
from throwcollect.robots.description import robot_of
from throwcollect.tasks.motions import KEY, SAME, motions_of


def count_motions(config: Config) -> int:
    """Count the motions that trials without swept keys have, one each; 0 if motions are not those of a file."""
    family = config.task.trajectory
    if not isinstance(family, MotionFile):
        return 0
    return len(motions_of(family, robot_of(config))) if family.motion is None else 1


def complete_point(values: Mapping[str, float], config: Config) -> dict[str, float]:
    """Add to the values of one trial what `add_motions` adds."""
    if not isinstance(config.task.trajectory, MotionFile):
        return dict(values)
    points = add_motions(Points(tuple(values), np.array([list(values.values())], np.float64)), config)
    return dict(zip(points.keys, points.values[0].tolist(), strict=True))


def add_motions(points: Points, config: Config) -> Points:
    """Add the motion of each trial, and its start and end where they differ from the configuration.

    Trials take the motions in turn, unless the configuration names one or the points have a column for it.
    """
    family = config.task.trajectory
    if not isinstance(family, MotionFile):
        return points
    motions = motions_of(family, robot_of(config))
    columns = dict(zip(points.keys, points.values.T, strict=True))
    first = motions.number_of(family.motion)
    if KEY not in columns:
        turn = np.arange(len(points.values)) % len(motions)
        columns[KEY] = (turn if family.motion is None else np.full_like(turn, first)) * 1.0
    # A number that no motion has is a reason to refuse its trial.
    chosen = np.clip(columns[KEY], 0, len(motions) - 1).astype(np.int64)
    for name, positions in motions.ends.items():
        for joint, values in positions.items():
            # Where the configuration has another value than the first motion, the user has set it.
            configured = getattr(config.task, name)[joint]
            if (values[chosen] != configured).any() and abs(values[first] - configured) <= SAME:
                columns.setdefault(f"task.{name}.{joint}", values[chosen])
    table = np.column_stack([*columns.values(), points.targets])
    return Points((*columns, *points.target_names), table)
