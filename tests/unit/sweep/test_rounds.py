"""Which trials come next in a plan that grows."""

import random
from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.sweep.own_plan import make_plan
from tests.unit.sweep.thrower import collect, configuration, go_on, throw

from throwcollect.errors import PlanError
from throwcollect.sweep.plan import make_trials
from throwcollect.sweep.rounds import Rounds
from throwcollect.sweep.samplers import draw_points
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

LANDED = throw(make_plan(configuration()).trials[0])
FAILED = ThrowResult(ThrowOutcome.RECAUGHT)


def test_the_throw_of_the_test_helper_lands() -> None:
    assert LANDED.outcome is ThrowOutcome.LANDED


def growing(**options: object) -> tuple[Rounds, list[Trial]]:
    config = configuration(**options)  # type: ignore[arg-type]
    rounds, trials = Rounds(config), make_plan(config).trials
    rounds.add(trials)
    return rounds, list(trials)


def test_a_plan_begins_with_two_rounds_without_results() -> None:
    config = configuration(trials=None, landed=1000)
    points = draw_points(config, directory=Path()).values
    assert [list(trial.values.values()) for trial in make_plan(config).trials] == points[:128].tolist()
    assert len(points) == 10_000


def test_a_round_is_due_when_all_rounds_but_the_last_have_ended() -> None:
    rounds, _ = growing()
    for number in range(64, 128):
        rounds.take_result(number, LANDED)
    for number in range(63):
        rounds.take_result(number, LANDED)
        assert not rounds.due
    rounds.take_result(63, LANDED)
    assert rounds.due


def test_a_round_does_not_wait_for_refused_trials() -> None:
    config = configuration()
    rounds = Rounds(config)
    trials = make_plan(config).trials
    rounds.add(trials.refuse(["too fast"] * len(trials)))
    assert rounds.due


def test_results_of_the_last_round_do_not_change_the_next_one() -> None:
    drawn = []
    for last in (LANDED, FAILED, None):
        rounds, trials = growing()
        for trial in trials[:64]:
            rounds.take_result(trial.number, throw(trial))
        for trial in trials[64:] if last else ():
            rounds.take_result(trial.number, last)
        points = rounds.draw()
        assert points is not None
        drawn.append(points.values.tolist())
    assert drawn[0] == drawn[1] == drawn[2]


def test_a_result_that_is_reported_twice_counts_once() -> None:
    rounds, _ = growing(target=None, landed=65)
    for number in [*range(64), *range(64)]:
        rounds.take_result(number, LANDED)
    assert rounds.due
    assert not rounds.over


def test_no_round_follows_when_enough_landed_without_the_last_round() -> None:
    rounds, _ = growing(trials=None, target=None, landed=64)
    for number in range(128):
        assert not rounds.over
        rounds.take_result(number, LANDED if number != 5 else FAILED)
    assert not rounds.over
    rounds, _ = growing(trials=None, target=None, landed=63)
    for number in range(64):
        assert not rounds.over
        rounds.take_result(number, LANDED if number != 5 else FAILED)
    assert rounds.over


@pytest.mark.parametrize("sampler", ["sobol", "uniform", "latin_hypercube"])
def test_until_serves_the_points_of_the_sampler_in_whole_rounds(sampler: str) -> None:
    config = configuration(trials=2000, target=None, landed=300, sampler=sampler)
    trials = collect(config)
    assert len(trials) % 64 == 0
    landings = [throw(trial).outcome is ThrowOutcome.LANDED for trial in trials]
    assert sum(landings) >= 300
    assert sum(landings[:-192]) < 300, "each round is there because those two before it were not enough"
    points = draw_points(config, directory=Path()).values[: len(trials)]
    assert [list(trial.values.values()) for trial in trials] == points.tolist()


def test_until_ends_when_trials_are_used_up() -> None:
    trials = collect(configuration(trials=200, target=None, landed=5000))
    assert [trial.number for trial in trials] == list(range(200))
    assert len(collect(configuration(trials=None, target=None, landed=20), throw=lambda _: FAILED)) == 200


def test_a_grid_ends_with_its_points_even_if_too_few_landed() -> None:
    axes = {
        "task.duration_s": {"min": 1.0, "max": 2.0, "count": 15},
        "ball.friction": {"values": [0.1 * i for i in range(10)]},
    }
    config = configuration(trials=None, target=None, landed=5000, sampler="grid", parameters=axes)
    assert len(collect(config, throw=lambda _: FAILED)) == 150


def test_a_sweep_with_a_target_needs_a_number_of_trials() -> None:
    with pytest.raises(PlanError, match=r"^trials: missing; the sampler sobol draws any number of trials$"):
        Rounds(configuration(trials=None))


@pytest.mark.parametrize("options", [{}, {"trials": None, "landed": 300}])
def test_the_order_in_which_trials_end_does_not_matter(options: dict[str, int]) -> None:
    config = configuration(**options)  # type: ignore[arg-type]
    expected = collect(config)

    def shuffle(trials: list[Trial]) -> list[Trial]:
        return random.Random(len(trials)).sample(trials, len(trials))

    assert collect(config, order=shuffle) == expected
    assert collect(config, order=reversed) == expected


@pytest.mark.parametrize("rounds", [2, 3, 4, 7])
def test_an_interrupted_collection_goes_on_with_the_same_trials(rounds: int) -> None:
    config = configuration(trials=500)
    left = collect(config, rounds=rounds)
    assert len(left) == 64 * rounds
    assert go_on(config, left) == collect(config)


def test_a_collection_may_go_on_beyond_its_shortened_last_round() -> None:
    few, more = configuration(trials=330), configuration(trials=500)
    begun = collect(few)
    assert len(begun) == 330
    assert go_on(more, begun) == collect(more)


def test_a_collection_that_was_shorter_than_two_rounds_may_go_on_as_well() -> None:
    begun = collect(configuration(trials=30))
    assert len(begun) == 30
    assert go_on(configuration(trials=330), begun) == collect(configuration(trials=330))


def test_trials_of_later_rounds_are_numbered_seeded_and_hashed_as_any_other() -> None:
    config = configuration(trials=300)
    trials = collect(config)
    assert [trial.number for trial in trials] == list(range(300))
    assert len({trial.seed for trial in trials}) == len({trial.digest for trial in trials}) == 300
    again = configuration(trials=300, target=None)
    points = draw_points(again, directory=Path())
    last = replace(points, values=points.values[:1] * 0 + [list(trials[-1].values.values())])
    assert make_trials(again, last, first=299)[0] == trials[-1]
