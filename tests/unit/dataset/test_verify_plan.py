"""The plan is drawn again from its configuration, and its refusals are checked again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.dataset.conftest import SETTINGS, Collection

from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import draw_plan, feasibility_check
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.dataset.verify import verify
from throwcollect.dataset.verify_plan import find_drawing_problems, find_refusal_problems
from throwcollect.sweep.digest import trial_digests
from throwcollect.sweep.plan import Plan, make_trials
from throwcollect.sweep.points import Points
from throwcollect.sweep.samplers import draw_points
from throwcollect.sweep.trials import Trials
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult


def draw_other_plan(plan: Plan, points: Points, *, seed: int | None = None) -> Plan:
    """A plan of other points, or with the seeds of another configuration, whose digests fit."""
    seeds = plan.config if seed is None else plan.config.model_copy(update={"seed": seed})
    drawn = make_trials(seeds, points).seeds
    return replace(plan, trials=Trials(points, drawn, trial_digests(plan.config, points, drawn)))


def test_a_plan_that_the_configuration_does_not_draw_is_found(collection: Collection, tmp_path: Path) -> None:
    points = draw_points(collection.config, directory=tmp_path)
    points.values[5] = 0.9
    collection.plan = draw_other_plan(collection.plan, points)
    (finding,) = verify(collection.collect(tmp_path / "dataset"))
    assert str(finding).startswith("plan.parquet: trial 5: has task.duration_s = 0.9, the configuration draws")


def test_seeds_that_the_configuration_does_not_give_are_found(collection: Collection, tmp_path: Path) -> None:
    points = draw_points(collection.config, directory=tmp_path)
    plan = draw_other_plan(collection.plan, points, seed=8)
    found = list(find_drawing_problems(tmp_path, plan, None))
    assert len(found) == len(plan.trials)
    assert "has seed" in found[0].problem


def test_a_plan_with_fewer_trials_is_found(collection: Collection, tmp_path: Path) -> None:
    plan = replace(collection.plan, trials=collection.plan.trials[:6])
    (finding,) = find_drawing_problems(tmp_path, plan, None)
    assert finding.problem == "has 6 trials, the configuration gives 7"


def test_invented_dropped_and_changed_refusals_are_found(tmp_path: Path) -> None:
    collection = Collection(
        {"trials": 2, "sweep": {"sampler": "grid", "parameters": {"task.duration_s": {"values": [0.3, 1.0]}}}}
    )
    honest = draw_plan(collection.config, directory=tmp_path)
    assert [trial.refused is None for trial in honest.trials] == [False, True]
    assert list(find_refusal_problems(honest, (), feasibility_check)) == []
    forged = replace(honest, trials=honest.trials.refuse([None, "too fast"]))
    dropped, invented = find_refusal_problems(forged, (), feasibility_check)
    assert dropped.problem.startswith("is refused as None, the check says 'arm_right_7_joint moves at")
    assert invented.problem == "is refused as 'too fast', the check says None"
    reason = honest.trials[0].refused
    assert reason is not None
    renamed = replace(honest, trials=honest.trials.refuse([reason.replace("_7_", "_4_"), None]))
    (found,) = find_refusal_problems(renamed, (), feasibility_check)
    assert found.problem.startswith("is refused as 'arm_right_4_joint moves at")


def test_where_a_plan_with_until_ends_is_not_checked_without_results(tmp_path: Path) -> None:
    config = Config.model_validate({**SETTINGS, "trials": None, "until": {"landed": 60}})
    points = draw_points(config, directory=tmp_path)
    plan = Plan(config, make_trials(config, points[:192]))
    assert list(find_drawing_problems(tmp_path, plan, None)) == []


@pytest.mark.parametrize(
    ("trials", "landed", "problem"),
    [
        (60, 60, None),
        (600, 59, None),
        (50, 50, "has 50 trials, the configuration gives 600"),
        (64, 64, "has 64 trials, the configuration gives 60"),
    ],
)
def test_the_end_of_a_plan_with_until_is_checked_against_the_results(
    tmp_path: Path, trials: int, landed: int, problem: str | None
) -> None:
    config = Config.model_validate({**SETTINGS, "trials": None, "until": {"landed": 60}})
    plan = Plan(config, make_trials(config, draw_points(config, directory=tmp_path)[:trials]))
    table = ThrowsTable.of(plan)
    outcomes = [ThrowOutcome.LANDED if number < landed else ThrowOutcome.TIMEOUT for number in range(trials)]
    throws = table.table(table.row(trial, ThrowResult(outcomes[trial.number]), None) for trial in plan.trials)
    assert [finding.problem for finding in find_drawing_problems(tmp_path, plan, throws)] == (
        [problem] if problem else []
    )
