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
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.points import Points, Targets
from throwcollect.sweep.trials import Trials

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
    sweep = SweepConfig(sampler="list", file=TRIALS, target=plans[0].config.sweep.target)
    config = plans[0].config.without_run().model_copy(update={"sweep": sweep, "trials": None, "until": None})
    parts = tuple(part for plan in different for part in plan.parts)
    joined = Plan(config, _join_trials(different), joined=parts if len(parts) > 1 else ())
    return joined, [firsts[place] for place in places]


def _join_trials(plans: Sequence[Plan]) -> Trials:
    if len(plans) == 1:
        return plans[0].trials
    keys = _find_keys(plans)
    refused: dict[int, str] = {}
    first = 0
    for plan in plans:
        refused |= {first + number: reason for number, reason in plan.trials.refused.items()}
        first += len(plan.trials)
    return Trials(
        Points(keys, np.vstack([_tabulate(plan, keys) for plan in plans]), _join_targets(plans)),
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


def _tabulate(plan: Plan, keys: Sequence[str]) -> Any:
    """Tabulate the values of some keys in all trials, shape ``(n_trials, n_keys)``."""
    swept, fixed, count = plan.keys, _collect_fixed_values(plan.config), len(plan.trials)
    columns = [plan.trials.values[:, swept.index(key)] if key in swept else np.full(count, fixed[key]) for key in keys]
    return np.column_stack([np.empty((count, 0)), *columns])


def _join_targets(plans: Sequence[Plan]) -> Targets | None:
    """Join the targets of all trials; NaN where a plan lacks a column."""
    present = {name for plan in plans for name in plan.trials.target_names}
    names = tuple(each.name for each in plans[0].config.task.target_columns if each.name in present)
    if not names:
        return None
    values = []
    for plan in plans:
        own, count = plan.trials.targets, len(plan.trials)
        missing = np.full(count, np.nan)
        columns = [own.values[:, own.names.index(name)] if own and name in own.names else missing for name in names]
        values.append(np.column_stack(columns))
    return Targets(names, np.vstack(values))
