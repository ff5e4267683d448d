"""From a configuration to a frozen plan on disk, before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.directory import TRIALS
from throwcollect.dataset.writer import create
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.feasibility import Feasibility
from throwcollect.sweep.plan import Check, Plan, make_plan, refusal
from throwcollect.sweep.point_file import read_points
from throwcollect.sweep.points import Points
from throwcollect.sweep.rounds import Rounds
from throwcollect.tasks.task import task_of

_MANY_TRIALS = 500
"""From here on, checking trials side by side is worth the start of processes."""
_TRIALS_A_PIECE = 100


def draw_plan(config: Config, *, directory: Path, processes: int = 1) -> Plan:
    """Draw all trials that are known before anything runs, and refuse those that the robot cannot do.

    Args:
        config: The configuration.
        directory: Where a relative `sweep.file` is looked for: the directory of the configuration's file.
        processes: How many processes may check the trials of a large plan; more than one import the program that calls
            this, as those of `multiprocessing` do.

    Raises:
        ConfigError: If the sweep cannot be drawn, or no trial is left.
    """
    check = feasibility_check(config)
    if processes == 1 or (config.trials or 0) < _MANY_TRIALS:
        return make_plan(config, check=check, directory=directory)
    plan = make_plan(config, directory=directory)
    return plan.refuse(_check_side_by_side(plan, processes))


def _check_side_by_side(plan: Plan, processes: int) -> list[str | None]:
    """Why trials of a plan cannot be run, in order; None for those that can."""
    trials = [trial.values for trial in plan.trials]
    pieces = [trials[first : first + _TRIALS_A_PIECE] for first in range(0, len(trials), _TRIALS_A_PIECE)]
    # New processes, as one that was forked off might hold what threads of this one had locked.
    with ProcessPoolExecutor(processes, get_context("spawn"), _prepare_to_check, (plan.config,)) as pool:
        return [reason for piece in pool.map(_check_piece, pieces) for reason in piece]


_find_refusal: Callable[[Mapping[str, float]], str | None]
"""What a process of `_check_side_by_side` checks trials with."""


def _prepare_to_check(config: Config) -> None:
    global _find_refusal  # noqa: PLW0603 - the only place that a process of a pool has
    check = feasibility_check(config)

    def find_refusal(values: Mapping[str, float]) -> str | None:
        return refusal(with_values(config, values), check)

    _find_refusal = find_refusal


def _check_piece(piece: Sequence[Mapping[str, float]]) -> list[str | None]:
    return [_find_refusal(values) for values in piece]


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


def prepare(config: Config, directory: Path, *, sweep_directory: Path, processes: int = 1) -> Plan:
    """Freeze the plan: write a dataset directory that holds the resolved configuration and all trials.

    Args:
        config: The configuration.
        directory: Directory of the dataset, new or empty.
        sweep_directory: Where a relative `sweep.file` is looked for.
        processes: As `draw_plan` takes it.

    Raises:
        ConfigError: If the sweep or the directory cannot be used; nothing is left behind then.
    """
    plan = draw_plan(config, directory=sweep_directory, processes=processes)
    plan = replace(plan, config=make_self_contained(config))
    try:
        create(directory, plan, listed=read_listed_points(config, directory=sweep_directory))
    except DatasetError as error:
        # Nothing has been started yet, so what is wrong is the choice of the directory.
        raise ConfigError(error.message, hint=error.hint) from error
    return plan
