"""Checks the plan against its configuration: the trials are drawn again, and the refused ones checked again."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.directory import PLAN, TRIALS
from throwcollect.dataset.findings import Finding
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.sweep.digest import trial_digests
from throwcollect.sweep.plan import Check, Plan, make_trials, refusal
from throwcollect.sweep.point_file import read_points
from throwcollect.sweep.points import Points
from throwcollect.sweep.samplers import draw_points
from throwcollect.wording import blank_numbers, format_count

CHECKED_AGAIN = 100
"""How many of the trials that the plan does not refuse are checked again as a sample; each takes 1 to 5 ms."""

_TOLERANCE = 1e-9
"""Values that are drawn again on another machine may differ in their last bits; relative, but absolute near 0."""

CheckOf = Callable[[Config], Check]
"""Makes the check of the trials of a configuration."""


def find_drawing_problems(directory: Path, plan: Plan, throws: pa.Table | None) -> Iterator[Finding]:
    """Find trials that are not those that the configuration draws, and a plan that does not end where it should.

    Where a plan with `until` has to end follows from the table of throws, which other checks compare with the episodes;
    without that table, this is not known.
    """
    # A list lies beside the plan and is compared with it there. Trials of joined plans have the seeds of these.
    if plan.config.sweep.file is not None:
        return
    try:
        points = draw_points(plan.config, directory=directory)
    except ConfigError as error:
        yield Finding(PLAN, "", f"cannot be drawn again from the configuration: {error.problems[0]}")
        return
    if points.keys != plan.keys:
        yield Finding(PLAN, "", f"the configuration sweeps {', '.join(points.keys)}, the plan {', '.join(plan.keys)}")
        return
    count, there = len(points.values), len(plan.trials)
    if plan.config.until is not None and throws is not None:
        count = _find_end(plan, throws, at_most=count)
    if count != there and (plan.config.until is None or throws is not None):
        yield Finding(PLAN, "", f"has {format_count(there, 'trial')}, the configuration gives {count}")
    drawn = make_trials(plan.config, points[:there])
    planned = plan.trials[: len(drawn)]
    same = _find_same(planned.values, drawn.values).all(axis=1) & (planned.seeds == drawn.seeds)
    for index in np.flatnonzero(~same):
        trial, again = planned[int(index)], drawn[int(index)]
        for key, value in again.values.items():
            if not _find_same(np.array(trial.values[key]), np.array(value)):
                yield _make_finding(
                    again.number, f"has {key} = {trial.values[key]!r}, the configuration draws {value!r}"
                )
        if trial.seed != again.seed:
            yield _make_finding(again.number, f"has seed {trial.seed}, the configuration gives {again.seed}")


def _find_same(planned: NDArray[np.float64], drawn: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the values of a plan that are the same when they are drawn again; all three arrays have one shape."""
    return np.isclose(planned, drawn, rtol=_TOLERANCE, atol=_TOLERANCE)


def _find_end(plan: Plan, throws: pa.Table, *, at_most: int) -> int:
    """Find how many trials a dataset has to have, the last of which brings as many successes as `until` asks for."""
    left = plan.config.until.wanted if plan.config.until else 0
    for number, outcome in zip(plan.trials.numbers, throws["outcome"].to_pylist(), strict=True):
        left -= outcome == plan.config.task.success
        if not left:
            return number + 1
    return at_most


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


def _strip_numbers(reason: str | None) -> str | None:
    """Replace the numbers of a reason, whose last digits may differ on another machine."""
    return None if reason is None else blank_numbers(reason)


def _make_finding(number: int, problem: str) -> Finding:
    return Finding(PLAN, f"trial {number}", problem)


def read_list(directory: Path, plan: Plan) -> Points:
    """Read the list of points that a dataset's own configuration names."""
    path = directory / TRIALS
    if not path.exists():
        raise DatasetError("is missing", path=path)
    try:
        points = read_points(path, plan.config)
    except ConfigError as error:
        raise DatasetError(error.problems[0].message, path=path) from error
    if points[: len(plan.trials)] != plan.trials.points:
        raise DatasetError(f"begins with other points than those of {PLAN}", path=path)
    return points


def find_wrong_trials(plan: Plan) -> dict[int, str]:
    """Find the trials of a plan that were changed since it was made, and the digests that their values and seeds give.

    Every trial has its digest in the plan.
    """
    trials = plan.trials
    digests = trial_digests(plan.config, trials.points, trials.seeds)
    wrong = np.flatnonzero((digests != trials.digests).any(axis=1)).tolist()
    return {trials.first + row: digests[row].tobytes().hex() for row in wrong}
