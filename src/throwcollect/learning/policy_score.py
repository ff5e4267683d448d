"""Scores a policy by letting it throw at targets in simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import FiniteFloat

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.learning.arrays import Array, ModelEntry
from throwcollect.learning.fitting import keep_informative
from throwcollect.learning.model import MODEL, load_model
from throwcollect.learning.score import Errors
from throwcollect.learning.scoring import Simulates, draw_targets
from throwcollect.progress_log import log_progress
from throwcollect.side_by_side import limit_processes


class PolicyScore(ModelEntry):
    """How a policy hits in one world, in simulation.

    Attributes:
        world: The world.
        targets: Number of targets of each seed.
        seed: The first seed of their choice.
        seeds: Number of seeds.
        hits: Share of throws that succeeded and ended at most `hit` from their target, in its unit.
        clipped: Share of their samples in which a command was beyond a limit.
        errors: By how much the targets are missed; medians over seeds.
    """

    world: str
    targets: int
    seed: int
    seeds: int
    hit: FiniteFloat
    hits: FiniteFloat
    clipped: FiniteFloat
    errors: Errors


def read_ends(directory: Path) -> Array:
    """Read where the throws of a model or of a dataset ended, shape ``(n, n_targets)``.

    Raises:
        ConfigError: If no throw succeeded, or its task has nothing to aim at.
        DatasetError: If there is neither, or it is damaged.
    """
    if (directory / MODEL).exists():
        return load_model(directory).learned.outputs
    dataset = Dataset.open(directory)
    task = dataset.config.task
    throws = keep_informative(task, dataset.throws, task.targets)
    if not task.targets or not len(throws):
        raise ConfigError(f"{directory}: no throw shows a target", expected="a dataset with throws that succeeded")
    return np.column_stack([throws[name].to_numpy() for name in task.targets])


def score_policy(
    ends: Array, worlds: Mapping[str, Simulates], count: int, seed: int, seeds: int, *, hit: float, processes: int
) -> list[PolicyScore]:
    """Let the policy of each world throw at targets.

    Args:
        ends: Where throws ended, over which targets are drawn evenly, shape ``(n, n_targets)``.
        worlds: Simulators of configurations with a policy, by how they are named.
        count: Number of targets of each seed; a model that was learned from these ends gets the same ones.
        seed: First seed of their choice.
        seeds: Number of seeds.
        hit: Largest miss of a hit, in the unit of the targets.
        processes: How many processes simulate.
    """
    targets = [draw_targets(ends, count, each) for each in range(seed, seed + seeds)]
    found = []
    for name, world in worlds.items():
        task = world.config.task
        columns = [next(each.name for each in task.target_columns if each.of == end) for end in task.targets]
        aimed = [dict(zip(columns, row, strict=True)) for row in np.vstack(targets).tolist()]
        throws = world.throw_many([{}] * len(aimed), targets=aimed, processes=limit_processes(processes, len(aimed)))
        rows = [throw.row for throw in log_progress(throws, len(aimed), "throw", "simulated")]
        kept = (task.success, *task.informative)
        # What did not succeed has no end; None becomes NaN.
        places = [[row[end] if row["outcome"] in kept else None for end in task.targets] for row in rows]
        away = np.array(places, np.float64) - np.vstack(targets)
        errors = Errors.middle([Errors.of(each, task.targets) for each in np.split(away, seeds)])
        hits = float((np.linalg.norm(away, axis=1) <= hit).mean())
        clipped = float(np.mean([row["clipped_share"] for row in rows]))
        found.append(
            PolicyScore(
                world=name, targets=count, seed=seed, seeds=seeds, hit=hit, hits=hits, clipped=clipped, errors=errors
            )
        )
    return found
