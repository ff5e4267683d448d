"""Rounds of a growing plan are drawn step by step, while trials run."""

from collections.abc import Collection
from pathlib import Path

import pytest
from tests.unit.sweep.columns import in_columns
from tests.unit.sweep.own_plan import make_plan
from tests.unit.sweep.thrower import collect, configuration, throw

from throwcollect.config.schema import Config
from throwcollect.coordinator.growth import Growth
from throwcollect.coordinator.prepare import draw_plan, more_trials
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.trials import Trial, Trials
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

FAST = {"task.duration_s": {"min": 0.4, "max": 1.2}, "task.trajectory.gamma": {"min": 1.0, "max": 1.4}}


def config(trials: int | None = 150, landed: int | None = None) -> Config:
    return configuration(trials=trials, landed=landed, target=None, parameters=FAST)


def tell_ends(growth: Growth, trials: Trials) -> None:
    for trial in trials:
        growth.take_result(trial.number, ThrowResult(ThrowOutcome.RECAUGHT))


def test_a_round_is_drawn_and_checked_trial_by_trial_once_it_is_due() -> None:
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    tell_ends(growth, plan.trials[:63])
    assert growth.step() is None
    tell_ends(growth, plan.trials[63:64])
    steps = [growth.step() for _ in range(1 + 22)]
    assert steps == [()] * 23
    assert not growth.over
    trials = growth.step()
    assert trials is not None
    assert [trial.number for trial in trials] == list(range(128, 150))
    assert growth.over
    assert growth.step() is None


def test_later_rounds_refuse_the_same_trials_as_a_plan_made_at_once() -> None:
    whole = draw_plan(config(landed=100).model_copy(update={"until": None}), directory=Path())
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    tell_ends(growth, plan.trials)
    later: list[Trial] = []
    while (trials := growth.step()) is not None:
        later += trials
    assert later == list(whole.trials[128:])
    assert 0 < sum(trial.refused is not None for trial in later) < len(later)


def resume(settings: Config, trials: list[Trial], *, lost: Collection[int] = ()) -> Growth:
    """The growth of a plan that an earlier collection left, with the results of all its trials."""
    growth = Growth(Plan(settings, in_columns(trials)), lost=lost)
    for trial in trials:
        if not growth.keep(trial.number, throw(trial)):
            growth.recall(trial.number, throw(trial))
    return growth


def go_on(growth: Growth) -> list[Trial]:
    """Confirm the rounds of an earlier collection with its results, then draw one more and return its trials."""
    while (earlier := growth.confirm()) is not None:
        for number, result in earlier.results.items():
            growth.recall(number, result)
    while not (trials := growth.step()):
        assert trials == ()
    return list(trials)


@pytest.mark.parametrize("rounds", [2, 3, 4, 6])
def test_a_growing_plan_goes_on_with_the_next_round_after_a_resume(rounds: int) -> None:
    settings = configuration(trials=500)
    growth = resume(settings, collect(settings, rounds=rounds))
    following = [trial.values for trial in collect(settings)[64 * rounds : 64 * (rounds + 1)]]
    assert [trial.values for trial in go_on(growth)] == following
    assert growth.take_wrong() is None


def test_an_incomplete_last_round_is_completed_after_a_resume_with_more_trials() -> None:
    growth = resume(configuration(trials=500), collect(configuration(trials=330)))
    following = [trial.values for trial in collect(configuration(trials=500))[330:384]]
    assert [trial.values for trial in go_on(growth)] == following
    assert growth.take_wrong() is None


def test_rounds_that_contradict_the_results_are_reported_and_drawn_again() -> None:
    settings = configuration(trials=500)
    lost = ThrowResult(ThrowOutcome.LOST)
    planned = collect(settings, throw=lambda trial: lost if trial.number == 3 else throw(trial), rounds=6)
    growth = resume(settings, planned, lost=[3])
    assert [trial.values for trial in go_on(growth)] == [trial.values for trial in collect(settings)[128:192]]
    assert growth.take_wrong() == (128, 256)
    assert growth.take_wrong() is None


def test_rounds_beyond_the_end_of_the_plan_are_reported() -> None:
    settings = configuration(trials=None, target=None, landed=63)
    lost, landed = ThrowResult(ThrowOutcome.LOST), throw(make_plan(settings).trials[0])
    planned = collect(settings, throw=lambda trial: lost if trial.number in (3, 4) else landed)
    assert len(planned) == 192
    growth = Growth(Plan(settings, in_columns(planned)))
    for number in range(64):
        growth.take_result(number, landed)
    assert growth.keep(130, landed)
    assert growth.confirm() is None
    assert growth.take_wrong() == (128, 1)
    assert growth.over


def test_no_round_is_drawn_until_all_earlier_rounds_are_confirmed() -> None:
    settings = configuration(trials=500)
    planned = collect(settings, rounds=4)
    growth = Growth(Plan(settings, in_columns(planned)))
    for trial in planned[1:64]:
        growth.take_result(trial.number, throw(trial))
    assert growth.confirm() is None
    assert growth.step() is None
    assert not growth.over
    growth.take_result(0, throw(planned[0]))
    assert growth.step() is None
    earlier = growth.confirm()
    assert earlier is not None
    assert list(earlier.trials.numbers) == list(range(128, 192))
    assert growth.confirm() is None


def test_a_growing_plan_says_how_many_trials_may_follow() -> None:
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    assert growth.most == 22
    assert more_trials(plan) == "; more follow from their results, until 100 have landed, at most 150 in all"
    assert more_trials(make_plan(config(trials=100, landed=100))) == ""
    assert more_trials(make_plan(config(trials=150))) == ""
    assert more_trials(make_plan(configuration())) == "; more follow from their results, at most 640 in all"
