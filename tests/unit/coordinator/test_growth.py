"""Rounds that are made a little at a time, while trials are run."""

from pathlib import Path

from tests.unit.sweep.columns import in_columns
from tests.unit.sweep.thrower import collected, configuration, throw

from throwcollect.config.schema import Config
from throwcollect.coordinator.growth import Growth
from throwcollect.coordinator.prepare import draw_plan, more_trials
from throwcollect.sweep.plan import Plan, make_plan
from throwcollect.sweep.trials import Trial, Trials
from throwcollect.tasks.throw.outcome import ThrowOutcome, ThrowResult

FAST = {"task.duration_s": {"min": 0.4, "max": 1.2}, "task.trajectory.gamma": {"min": 1.0, "max": 1.4}}


def config(trials: int | None = 150, landed: int | None = None) -> Config:
    return configuration(trials=trials, landed=landed, target=None, parameters=FAST)


def ended(growth: Growth, trials: Trials) -> None:
    for trial in trials:
        growth.tell(trial.number, ThrowResult(ThrowOutcome.RECAUGHT))


def test_a_round_is_drawn_and_checked_trial_by_trial_once_it_is_due() -> None:
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    ended(growth, plan.trials[:63])
    assert growth.step() is None
    ended(growth, plan.trials[63:64])
    steps = [growth.step() for _ in range(1 + 22)]
    assert steps == [()] * 23
    assert not growth.over
    trials = growth.step()
    assert trials is not None
    assert [trial.number for trial in trials] == list(range(128, 150))
    assert growth.over
    assert growth.step() is None


def test_trials_of_later_rounds_are_refused_as_those_of_a_plan_made_at_once() -> None:
    whole = draw_plan(config(landed=100).model_copy(update={"until": None}), directory=Path())
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    ended(growth, plan.trials)
    later: list[Trial] = []
    while (trials := growth.step()) is not None:
        later += trials
    assert later == list(whole.trials[128:])
    assert 0 < sum(trial.refused is not None for trial in later) < len(later)


def test_a_plan_that_has_rounds_already_goes_on_where_it_was() -> None:
    settings = configuration(trials=256)
    growth = Growth(Plan(settings, in_columns(collected(settings, rounds=3))))
    for trial in collected(settings, rounds=3):
        growth.tell(trial.number, throw(trial))
    steps = []
    while (trials := growth.step()) is not None:
        steps.append(trials)
    assert steps[0] == ()
    assert [trial.values for trial in steps[-1]] == [trial.values for trial in collected(settings)[192:]]


def test_it_says_how_many_trials_may_follow() -> None:
    plan = make_plan(config(landed=100))
    growth = Growth(plan)
    assert growth.most == 22
    assert more_trials(plan) == "; more follow from their results, until 100 have landed, at most 150 in all"
    assert more_trials(make_plan(config(trials=100, landed=100))) == ""
    assert more_trials(make_plan(config(trials=150))) == ""
    assert more_trials(make_plan(configuration())) == "; more follow from their results, at most 640 in all"
