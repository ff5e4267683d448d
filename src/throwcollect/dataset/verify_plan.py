"""Checks the plan against its configuration: the trials are drawn again, and the refused ones checked again."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.directory import PLAN
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.throws_table import Row, ThrowsTable
from throwcollect.errors import ConfigError
from throwcollect.extras import is_installed
from throwcollect.sweep.plan import ROUND_TRIALS, Check, Plan, make_trials, refusal
from throwcollect.sweep.points import Points
from throwcollect.sweep.rounds import Rounds, find_same
from throwcollect.sweep.samplers import draw_points
from throwcollect.tasks.result import LOST, REFUSED
from throwcollect.wording import blank_numbers, format_count

CHECKED_AGAIN = 100
"""How many of the trials that the plan does not refuse are checked again as a sample; each takes 1 to 5 ms."""

CheckOf = Callable[[Config], Check]
"""Makes the check of the trials of a configuration."""


def can_draw(config: Config) -> bool:
    """Whether the trials of a configuration can be drawn here: `sweep.target` needs SciPy, which may be missing."""
    return config.sweep.target is None or is_installed("scipy")


def find_drawing_problems(directory: Path, plan: Plan, rows: Mapping[int, Row] | None) -> Iterator[Finding]:
    """Find trials that are not those that the configuration draws.

    The rounds of a plan that grows are drawn from the results in the table of throws, which other checks compare with
    the episodes. Rounds after a lost trial that do not follow from its loss are not compared, as they may follow from
    an episode that it had when they were drawn. If the rows of the table of throws are not known, only what depends on
    no result is drawn again. A plan that cannot be drawn here (see `can_draw`) is not compared.
    """
    # The trials of a joined plan have the seeds of the plans that it joins.
    if plan.joined or not can_draw(plan.config):
        return
    try:
        drawing = _draw_rounds(plan, rows) if plan.config.grows else _draw(directory, plan)
    except ConfigError as error:
        yield Finding(PLAN, "", f"cannot be drawn again from the configuration: {error.problems[0]}")
        return
    if drawing.problem is not None:
        yield Finding(PLAN, "", drawing.problem)
    drawn = make_trials(plan.config, Points(plan.keys, drawing.values[: len(plan.trials)]))
    planned = plan.trials[: len(drawn)]
    same = find_same(planned.values, drawn.values).all(axis=1) & (planned.seeds == drawn.seeds)
    for index in np.flatnonzero(~same):
        trial, again = planned[int(index)], drawn[int(index)]
        for key, value in again.values.items():
            if not find_same(np.array(trial.values[key]), np.array(value)):
                yield _make_finding(
                    again.number, f"has {key} = {trial.values[key]!r}, the configuration draws {value!r}"
                )
        if trial.seed != again.seed:
            yield _make_finding(again.number, f"has seed {trial.seed}, the configuration gives {again.seed}")


def find_refusal_problems(plan: Plan, doubtful: Collection[int], check_of: CheckOf) -> Iterator[Finding]:
    """Find refusals that the plan should not have, and ones that it lacks.

    All refused trials are checked again, and `CHECKED_AGAIN` others that the seed of the configuration chooses, except
    the doubtful ones, whose values are not known.
    """
    refused = plan.trials.refused
    others = [number for number in plan.trials.numbers if number not in refused]
    # Every verification checks the same trials again, so that two verifications agree.
    chosen = np.random.default_rng(plan.config.seed).permutation(len(others))[:CHECKED_AGAIN]
    check = check_of(plan.config)
    for number in sorted({*refused, *(others[index] for index in chosen)} - set(doubtful)):
        trial = plan.trial(number)
        again = refusal(plan.config_of(trial), check)
        if _strip_numbers(again) != _strip_numbers(trial.refused):
            yield _make_finding(number, f"is refused as {trial.refused!r}, the check says {again!r}")


class _Drawing(NamedTuple):
    """The trials that a configuration draws, as far as they are known: values of shape ``(n_trials, n_keys)``.

    The problem says why they are not as many as the plan has; None if they are, or if that is not known.
    """

    values: NDArray[np.float64]
    problem: str | None


def _draw(directory: Path, plan: Plan) -> _Drawing:
    """Draw the trials of a plan that is fixed before anything runs."""
    if plan.config.sweep.file is not None:
        # The list lies beside the plan and is compared with it there.
        return _Drawing(plan.trials.values, None)
    points = _require_keys(draw_points(plan.config, directory=directory), plan)
    count, there = len(points.values), len(plan.trials)
    return _Drawing(
        points.values,
        None if count == there else f"has {format_count(there, 'trial')}, the configuration draws {count}",
    )


def _draw_rounds(plan: Plan, rows: Mapping[int, Row] | None) -> _Drawing:
    """Draw the trials of a plan that grew, round by round from their results."""
    rounds, table, there = Rounds(plan.config), ThrowsTable.of(plan), len(plan.trials)
    values: list[NDArray[np.float64]] = []
    lost: int | None = None

    def is_doubtful() -> bool:
        """Whether the next round depends on a lost trial, which may have had an episode when the round was drawn."""
        return lost is not None and rounds.planned >= (lost // ROUND_TRIALS + 2) * ROUND_TRIALS

    while rounds.due and not rounds.over and rounds.planned < there:
        points = _require_keys(rounds.draw(), plan)
        added = plan.trials[rounds.planned : rounds.planned + len(points.values)]
        if is_doubtful() and not find_same(added.values, points.values[: len(added)]).all():
            break
        values.append(points.values)
        rounds.add(added)
        for trial in added:
            row = None if rows is None else rows.get(trial.number)
            if row is not None and row["outcome"] != REFUSED:
                rounds.take_result(trial.number, table.result(row))
                lost = trial.number if lost is None and row["outcome"] == LOST else lost
    problem, count = None, sum(map(len, values))
    if not is_doubtful():
        if count > there or (rounds.over and count < there):
            problem = f"has {format_count(there, 'trial')}, the configuration draws {count}"
        elif rounds.due and not rounds.over:
            problem = f"ends with trial {there - 1}, but more would follow from the results"
    return _Drawing(np.vstack(values), problem)


def _require_keys(points: Points, plan: Plan) -> Points:
    if points.keys != plan.keys:
        raise ConfigError(f"it sweeps {', '.join(points.keys)}, the plan {', '.join(plan.keys)}")
    return points


def _strip_numbers(reason: str | None) -> str | None:
    """Replace the numbers of a reason, whose last digits may differ on another machine."""
    return None if reason is None else blank_numbers(reason)


def _make_finding(number: int, problem: str) -> Finding:
    return Finding(PLAN, f"trial {number}", problem)
