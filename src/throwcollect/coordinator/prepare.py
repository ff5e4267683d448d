"""From a configuration to a frozen plan on disk, before anything runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.directory import TRIALS
from throwcollect.dataset.writer import create
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.feasibility import Feasibility
from throwcollect.side_by_side import work_side_by_side
from throwcollect.sweep.plan import Check, Plan, make_plan, refusal
from throwcollect.sweep.point_file import read_points
from throwcollect.sweep.points import Points
from throwcollect.sweep.rounds import Rounds
from throwcollect.tasks.task import task_of

_MANY_TRIALS = 500
"""From here on, checking trials side by side is worth the start of processes."""
_TRIALS_A_PIECE = 100
_TELL_EVERY_S = 10.0

Say = Callable[[str], object]


def draw_plan(config: Config, *, directory: Path, processes: int = 1, say: Say = lambda _: None) -> Plan:
    """Draw all trials that are known before anything runs, and refuse those that the robot cannot do.

    Args:
        config: The configuration.
        directory: Where a relative `sweep.file` is looked for: the directory of the configuration's file.
        processes: How many processes may check the trials of a large plan; more than one import the program that calls
            this, as those of `multiprocessing` do.
        say: Is told now and then how many trials of a large plan have been checked.

    Raises:
        ConfigError: If the sweep cannot be drawn, or no trial is left.
        WorkerError: If a process that checks trials is killed.
    """
    plan = make_plan(config, directory=directory)
    keys, count = plan.keys, len(plan.trials)
    values = np.array([[trial.values[key] for key in keys] for trial in plan.trials])
    pieces = [values[first : first + _TRIALS_A_PIECE] for first in range(0, count, _TRIALS_A_PIECE)]
    found = work_side_by_side(
        pieces,
        _find_refusals,
        (config, keys),
        processes=processes if count >= _MANY_TRIALS else 1,
        doing="checks trials",
    )
    reasons: list[str | None] = []
    told = time.monotonic()
    for piece in found:
        reasons += piece
        if time.monotonic() >= told + _TELL_EVERY_S:
            told = time.monotonic()
            say(f"plan: {len(reasons)} of {count} trials checked")
    return plan.refuse(reasons)


def _find_refusals(config: Config, keys: tuple[str, ...]) -> Callable[[NDArray[np.float64]], list[str | None]]:
    """Make what says of trials, by rows of their values, why they cannot be run; None of those that can."""
    check = feasibility_check(config)

    def find(rows: NDArray[np.float64]) -> list[str | None]:
        trials = (dict(zip(keys, row, strict=True)) for row in rows.tolist())
        return [refusal(with_values(config, values), check) for values in trials]

    return find


def feasibility_check(config: Config) -> Check:
    """Says of trials of a configuration why the robot cannot do them, in 1 to 5 ms each.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    feasibility = Feasibility(config)
    return lambda trial: feasibility.check(trial, task_of(trial).trajectory())


def more_trials(plan: Plan) -> str:
    """What is said behind the number of a plan's trials: whether more will follow, and how many."""
    rounds = Rounds(plan.config) if plan.config.grows else None
    if rounds is None or len(plan.trials) >= rounds.limit:
        return ""
    wanted = plan.config.until
    until = f", until {wanted.wanted} have {wanted.outcome()}" if wanted else ""
    return f"; more follow from their results{until}, at most {rounds.limit} in all"


def make_self_contained(config: Config) -> Config:
    """The configuration as a dataset has it: a list of trials lies beside it."""
    if config.sweep.file is None:
        return config
    return config.model_copy(update={"sweep": config.sweep.model_copy(update={"file": TRIALS})})


def read_listed_points(config: Config, *, directory: Path) -> Points | None:
    """All points of the list that a configuration names, whether its plan takes them or not; None if it names none.

    Args:
        config: The configuration.
        directory: Where a relative `sweep.file` is looked for.

    Raises:
        ConfigError: If the list cannot be used.
    """
    return None if config.sweep.file is None else read_points(directory / config.sweep.file, config)


def prepare(
    config: Config, directory: Path, *, sweep_directory: Path, processes: int = 1, say: Say = lambda _: None
) -> Plan:
    """Freeze the plan: write a dataset directory that holds the resolved configuration and all trials.

    Args:
        config: The configuration.
        directory: Directory of the dataset, new or empty.
        sweep_directory: Where a relative `sweep.file` is looked for.
        processes: As `draw_plan` takes it.
        say: As `draw_plan` takes it.

    Raises:
        ConfigError: If the sweep or the directory cannot be used; nothing is left behind then.
        WorkerError: If a process that checks trials is killed.
    """
    plan = draw_plan(config, directory=sweep_directory, processes=processes, say=say)
    plan = replace(plan, config=make_self_contained(config))
    try:
        create(directory, plan, listed=read_listed_points(config, directory=sweep_directory))
    except DatasetError as error:
        # Nothing has been started yet, so what is wrong is the choice of the directory.
        raise ConfigError(error.message, hint=error.hint) from error
    return plan
