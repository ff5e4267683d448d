"""Joins the plans of several datasets into one, in which their trials follow each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from throwcollect.config.loader import value_as_yaml
from throwcollect.config.schema import Config, SweepConfig
from throwcollect.config.values import leaves, reason_not_sweepable
from throwcollect.dataset.directory import TRIALS
from throwcollect.errors import ConfigError, Problem
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import Points, Trials

_ABSENT = object()


def join_plans(plans: Sequence[Plan]) -> tuple[Plan, list[int]]:
    """Join plans; those with the same trials are one, such as those of the parts of a split.

    Returns:
        The joined plan, and the number that trial 0 of each plan has there. Its configuration is that of the first
        plan, which takes its points from a file. It sweeps the keys that any plan sweeps, and those that the plans have
        fixed at different values. Seeds and digests are those of the plans.
    """
    different: list[Plan] = []
    places = []
    for plan in plans:
        place = next((place for place, other in enumerate(different) if other.trials == plan.trials), len(different))
        different += [plan] if place == len(different) else []
        places.append(place)
    firsts = np.cumsum([0, *(len(plan.trials) for plan in different)]).tolist()
    trials, sweep = _join_trials(different), SweepConfig()
    # Trials of sessions have no values.
    if trials.points.names:
        sweep = SweepConfig(sampler="list", file=TRIALS, target=plans[0].config.sweep.target)
    config = plans[0].config.without_run().model_copy(update={"sweep": sweep, "trials": None, "until": None})
    parts = tuple(part for plan in different for part in plan.parts)
    joined = Plan(config, trials, joined=parts if len(parts) > 1 else ())
    return joined, [firsts[place] for place in places]


def _join_trials(plans: Sequence[Plan]) -> Trials:
    if len(plans) == 1:
        return plans[0].trials
    keys = _find_keys(plans)
    present = {name for plan in plans for name in plan.trials.points.target_names}
    targets = tuple(each.name for each in plans[0].config.task.target_columns if each.name in present)
    refused: dict[int, str] = {}
    first = 0
    for plan in plans:
        refused |= {first + number: reason for number, reason in plan.trials.refused.items()}
        first += len(plan.trials)
    return Trials(
        Points((*keys, *targets), np.vstack([_tabulate(plan, keys, targets) for plan in plans])),
        np.concatenate([plan.trials.seeds for plan in plans]),
        np.concatenate([plan.trials.digests for plan in plans]),
        refused=refused,
    )


def _find_keys(plans: Sequence[Plan]) -> tuple[str, ...]:
    """Find the keys that vary between the trials of some plans; refuse plans that differ in others."""
    keys = dict.fromkeys(key for plan in plans for key in plan.keys)
    fixed = [_collect_fixed_values(plan.config) for plan in plans]
    problems = []
    for key in dict.fromkeys(key for values in fixed for key in values):
        values = [each.get(key, _ABSENT) for each in fixed]
        if _ABSENT in values:
            obstacle: str | None = "not all have this key"
        elif key in keys or all(value == values[0] for value in values):
            continue
        else:
            obstacle = reason_not_sweepable(plans[0].config, key)
        if obstacle is None:
            keys[key] = None
        else:
            texts = dict.fromkeys("absent" if value is _ABSENT else value_as_yaml(value) for value in values)
            problems.append(Problem(f"is {' and '.join(texts)} in the datasets; {obstacle}", key))
    if problems:
        raise ConfigError(problems, expected="datasets that differ only in what a sweep may vary")
    return tuple(keys)


def _collect_fixed_values(config: Config) -> dict[str, Any]:
    return {leaf.name: leaf.value for leaf in leaves(config) if leaf.key.determines_samples}


def _tabulate(plan: Plan, keys: Sequence[str], targets: Sequence[str]) -> Any:
    """Tabulate some keys and targets of all trials, shape ``(n_trials, n_columns)``; NaN where they lack a target."""
    points, fixed = plan.trials.points, {**_collect_fixed_values(plan.config), **dict.fromkeys(targets, np.nan)}
    swept = dict(zip(points.names, points.table.T, strict=True))
    columns = [swept[name] if name in swept else np.full(len(points), fixed[name]) for name in (*keys, *targets)]
    return np.column_stack([np.empty((len(points), 0)), *columns])
