"""Joins the plans of several datasets: the keys that they have in common, and those that vary between their trials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from throwcollect.config.loader import value_as_yaml
from throwcollect.config.schema import Config, SweepConfig
from throwcollect.config.values import leaves, reason_not_sweepable
from throwcollect.dataset.directory import TRIALS
from throwcollect.derive.source import Source
from throwcollect.errors import ConfigError, Problem
from throwcollect.sweep.points import Points, Targets
from throwcollect.wording import command

_ABSENT = object()


def list_of_trials(sources: Sequence[Source]) -> tuple[Config, Points]:
    """Make a configuration whose trials are those of all sources, at least one, one after the other.

    Returns:
        The configuration of the first source, which takes its points from a file; and the points. The sweep varies the
        keys that any source sweeps, and those that the sources have fixed at different values; for this, the
        configuration has the offsets of all joints for which any source has one.
    """
    configs = _add_missing_offsets([source.dataset.config for source in sources])
    keys = list(dict.fromkeys(key for source in sources for key in source.dataset.plan.keys))
    fixed = [_collect_fixed_values(config) for config in configs]
    problems = []
    for key in dict.fromkeys(key for values in fixed for key in values):
        values = [each.get(key, _ABSENT) for each in fixed]
        if _ABSENT in values:
            obstacle: str | None = "not all have this key"
        elif key in keys or all(value == values[0] for value in values):
            continue
        else:
            obstacle = reason_not_sweepable(configs[0], key)
        if obstacle is None:
            keys.append(key)
        else:
            problems.append(Problem(f"{_list_differences(sources, values)}; {obstacle}", key))
    if problems:
        expected = "datasets that differ only in what a sweep may vary"
        raise ConfigError(problems, expected=expected, hint=_explain_how_to_compare(sources))
    rows = [
        [source.dataset.plan.trial(number).values.get(key, values[key]) for key in keys]
        for source, values in zip(sources, fixed, strict=True)
        for number in source.trials
    ]
    points = Points(tuple(keys), np.array(rows, np.float64), _gather_targets(sources))
    sweep = SweepConfig(sampler="list", file=TRIALS, target=configs[0].sweep.target)
    config = configs[0].without_run().model_copy(update={"sweep": sweep, "trials": None, "until": None})
    return config, points


def _explain_how_to_compare(sources: Sequence[Source]) -> str | None:
    """Name the command that compares two engines; None if all datasets are of one."""
    first, *others = [source.dataset for source in sources]
    engine = next(
        (each.config.sim.engine for each in others if each.config.sim.engine != first.config.sim.engine), None
    )
    if engine is None:
        return None
    compare = command("dataset", "replay", first.directory, "--all", "--engine", engine)
    return f"{compare} tells by how much throws of the two engines differ"


def _gather_targets(sources: Sequence[Source]) -> Targets | None:
    """Gather the targets of all trials; NaN in columns of targets that a source lacks."""
    task = sources[0].dataset.config.task
    present = {name for source in sources for name in source.dataset.plan.trials.target_names}
    names = tuple(each.name for each in task.target_columns if each.name in present)
    if not names:
        return None
    trials = (source.dataset.plan.trial(number) for source in sources for number in source.trials)
    return Targets(names, np.array([[trial.target.get(name, np.nan) for name in names] for trial in trials]))


def _add_missing_offsets(configs: Sequence[Config]) -> list[Config]:
    """Add offsets of 0, which is the same as none, for the joints that have an offset in another configuration."""
    joints = dict.fromkeys(joint for config in configs for joint in config.robot.joint_offsets)
    return [
        config.model_copy(
            update={
                "robot": config.robot.model_copy(
                    update={"joint_offsets": {**dict.fromkeys(joints, 0.0), **config.robot.joint_offsets}}
                )
            }
        )
        for config in configs
    ]


def _collect_fixed_values(config: Config) -> dict[str, Any]:
    return {leaf.name: leaf.value for leaf in leaves(config) if leaf.key.determines_samples}


def _list_differences(sources: Sequence[Source], values: Sequence[Any]) -> str:
    directories: dict[str, list[str]] = {}
    for source, value in zip(sources, values, strict=True):
        text = "absent" if value is _ABSENT else value_as_yaml(value)
        directories.setdefault(text, []).append(str(source.dataset.directory))
    return ", ".join(f"{text} in {' and '.join(where)}" for text, where in directories.items())
