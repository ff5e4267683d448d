"""From a configuration to a frozen plan on disk, before anything runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.config.key import key_of_field
from throwcollect.config.robot_config import RobotConfig
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.creation import create, refuse_many_files, refuse_taken
from throwcollect.dataset.directory import TRIALS
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.plan.plan import Check, Plan, check_some_left, make_trials
from throwcollect.plan.point_file import read_points
from throwcollect.plan.samplers import draw_points
from throwcollect.plan.trials import Points
from throwcollect.robots.description import robot_of
from throwcollect.robots.feasibility import Feasibility
from throwcollect.robots.oddities import find_placeholders
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sensing.sensor import check_sensors
from throwcollect.side_by_side import working_side_by_side
from throwcollect.sim.policy import find_policy
from throwcollect.tasks.task import trajectory_of
from throwcollect.wording import format_count

_MANY_TRIALS = 2000
"""From this number of trials on, starting processes that check them side by side saves time."""
_TRIALS_A_PIECE, _MOST_A_PIECE = 100, 1000
"""Similar trials share work, so large plans are cut into larger pieces; to hand over many pieces takes time, too."""
_REPORT_FIRST_S = 2.0
_REPORT_EVERY_S = 10.0


def draw_plan(config: Config, *, directory: Path, processes: int = 1, reporter: Reporter = SILENT) -> Plan:
    """Draw all trials, and refuse those that the robot cannot do.

    With `until`, only as many trials as have to succeed are checked, because the dataset has at least these; the
    collection checks the others when their turn comes.

    Args:
        config: The configuration.
        directory: Where a relative `sweep.file` is looked for: the directory of the configuration's file.
        processes: How many processes may check the trials of a large plan. If more than one, they import the program
            that calls this, as processes of `multiprocessing` do.
        reporter: Receives how many trials of a large plan have been checked, and warnings of limits that may be wrong.
    """
    points = draw_points(config, directory=directory)
    for sentence in find_placeholders(robot_of(config)):
        reporter.warn(f"warning: {sentence}")
    # The table checks the task, which may be of another package and broken: without this, each trial would be refused.
    ThrowsTable((), config)
    if config.task.policy is not None:
        find_policy(config)
    check_sensors(config)
    refuse_many_files(config, len(points.values))
    count = count_first(config, len(points.values))
    size = max(_TRIALS_A_PIECE, min(_MOST_A_PIECE, count // 10))
    pieces = [points[first : min(first + size, count)] for first in range(0, count, size)]
    processes = processes if count >= _MANY_TRIALS else 1
    say_at = time.monotonic() + _REPORT_FIRST_S
    reasons: list[str | None] = []
    with working_side_by_side(pieces, _make_checks, (config,), processes=processes, doing="checks trials") as checked:
        for piece in checked:
            reasons += piece
            if time.monotonic() >= say_at:
                say_at = time.monotonic() + _REPORT_EVERY_S
                reporter.say(f"plan: {len(reasons)} of {count} trials checked")
    # If some trials have not been checked, and few have, others may be left that can be run.
    if count == len(points.values) or count >= _TRIALS_A_PIECE:
        check_some_left(reasons)
    refused = {number: reason for number, reason in enumerate(reasons) if reason is not None}
    return Plan(config, replace(make_trials(config, points), refused=refused))


def count_first(config: Config, trials: int) -> int:
    """Count the trials, of all trials of a plan, that the dataset has in any case, and that are checked beforehand."""
    return trials if config.until is None else min(trials, config.until.wanted)


def _make_checks(config: Config) -> Callable[[Points], list[str | None]]:
    """Make a function that returns for each of some points why the robot cannot do its trial; None if it can."""
    feasibility = Feasibility(config)

    def find_reasons(points: Points) -> list[str | None]:
        rows = (dict(zip(points.keys, row, strict=True)) for row in points.values.tolist())
        trials = [with_values(config, values) for values in rows]
        planned = {}
        for number, trial in enumerate(trials):
            # The check, which comes to the same error, makes it the reason of a refusal.
            with suppress(ConfigError):
                planned[number] = _plan_motion(trial)
        sure = dict(zip(planned, feasibility.find_feasible([*planned.values()]), strict=True))
        return [None if sure.get(number) else _check(feasibility, trial) for number, trial in enumerate(trials)]

    return find_reasons


def feasibility_check(config: Config) -> Check:
    """Make a function that returns why the robot cannot do a trial, in 2 to 5 ms each.

    With `sweep.feasibility: nominal`, the function checks the robot as its owner believes it to be.
    """
    return partial(_check, Feasibility(config))


def _check(feasibility: Feasibility, trial: Config) -> str | None:
    try:
        return feasibility.check(*_plan_motion(trial))
    except ConfigError as error:
        return str(error)


def _plan_motion(trial: Config) -> tuple[Config, JointTrajectory]:
    """Return the configuration by which a trial is checked, and its trajectory."""
    return _replace_by_nominal_robot(trial) if trial.sweep.feasibility == "nominal" else trial, trajectory_of(trial)


def _replace_by_nominal_robot(config: Config) -> Config:
    """Replace all numbers of robot, tool and ball that one has to measure by their defaults."""
    fields = RobotConfig.model_fields
    measured = {name: each.default for name, each in fields.items() if key_of_field(RobotConfig, name).swept}
    tool = type(config.tool).model_validate({"name": config.tool.name})
    return config.model_copy(
        update={"robot": config.robot.model_copy(update=measured), "tool": tool, "ball": type(config.ball)()}
    )


def describe_plan(plan: Plan) -> str:
    """Write the number of a plan's trials, how many of them the robot cannot do, and when the dataset ends before."""
    refused = len(plan.trials.refused)
    note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
    return f"{count_trials(plan)}{note}"


def count_trials(plan: Plan) -> str:
    """Write the number of a plan's trials, and when the dataset ends before the last one."""
    goal = plan.config.until
    if goal is None:
        return format_count(len(plan.trials), "trial")
    return f"at most {format_count(len(plan.trials), 'trial')}, until {goal.wanted} have {goal.outcome()}"


def make_self_contained(config: Config) -> Config:
    """Make the configuration as a dataset stores it: with its list of trials in the same directory."""
    if config.sweep.file is None:
        return config
    return config.model_copy(update={"sweep": config.sweep.model_copy(update={"file": TRIALS})})


def read_listed_points(config: Config, *, directory: Path) -> Points | None:
    """Read all points of the list that a configuration names, even those beyond its plan; None if it names none.

    A relative `sweep.file` is looked for in the directory.
    """
    return None if config.sweep.file is None else read_points(directory / config.sweep.file, config)


def prepare(
    config: Config,
    directory: Path,
    *,
    sweep_directory: Path,
    processes: int = 1,
    reporter: Reporter = SILENT,
) -> Plan:
    """Freeze the plan: write a dataset directory that holds the resolved configuration and all trials.

    The directory has to be new or empty. A relative `sweep.file` is looked for in `sweep_directory`. The rest is as for
    `draw_plan`.
    """
    # To check many trials takes minutes, so what needs no plan is looked at before.
    refuse_taken(directory)
    plan = draw_plan(config, directory=sweep_directory, processes=processes, reporter=reporter)
    # This comes after the plan is drawn, because the configuration as it was given names the place of its list.
    plan = replace(plan, config=make_self_contained(config))
    try:
        create(directory, plan, listed=read_listed_points(config, directory=sweep_directory))
    except DatasetError as error:
        # Nothing has been started yet, so the error is in the choice of the directory.
        raise ConfigError(error.message, hint=error.hint) from error
    return plan
