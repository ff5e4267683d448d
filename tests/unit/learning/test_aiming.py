"""Aiming at targets in a world in closed form."""

import numpy as np
import pytest
from tests.unit.learning.worlds import HIGH, KEYS, LOW, draw, effort, land, learn, learn_with_drag

from throwcollect.learning.aiming import Choice, aim
from throwcollect.learning.learned_map import Correction, KeyRole, LearnedMap, find_nearest


def throw(learned: LearnedMap, targets: np.ndarray, choice: Choice = Choice.NEAREST):
    """Aim, and throw; returns the values and how far each throw was off."""
    found = aim(learned, targets, np.zeros((len(targets), 0)), choice)
    values = learned.unscale(KeyRole.PARAMETER, found.parameters)
    return found, values, np.linalg.norm(land(values) - targets, axis=1)


@pytest.fixture(scope="module")
def targets() -> np.ndarray:
    return land(draw(40, seed=5, inside=0.6))


def test_aimed_throws_end_at_their_targets(targets: np.ndarray) -> None:
    found, _, off = throw(learn(), targets)
    assert found.reachable.all()
    assert np.linalg.norm(found.predicted - targets, axis=1).max() < 1e-3
    assert np.median(off) < 0.0005
    assert off.max() < 0.002


@pytest.mark.parametrize("choice", Choice)
def test_the_aim_for_a_target_does_not_depend_on_the_other_targets(choice: Choice, targets: np.ndarray) -> None:
    learned = learn(60)
    far = np.concatenate([targets, targets * 3])
    together, _, _ = throw(learned, far, choice)
    for number in (0, 31, 32, 79):
        alone, _, _ = throw(learned, far[number : number + 1], choice)
        for name in ("parameters", "predicted", "nearest_place", "reachable"):
            np.testing.assert_array_equal(getattr(together, name)[number], getattr(alone, name)[0])


def test_every_target_is_aimed_at_in_its_own_context(targets: np.ndarray) -> None:
    learned = learn_with_drag(role=KeyRole.CONTEXT)
    context = np.linspace(-1.0, 1.0, len(targets))[:, np.newaxis]
    together = aim(learned, targets, context)
    for number in (0, 20, 39):
        alone = aim(learned, targets[number : number + 1], context[number : number + 1])
        np.testing.assert_array_equal(together.parameters[number], alone.parameters[0])
        np.testing.assert_array_equal(together.nearest_place[number], alone.nearest_place[0])
    # Drag slows the ball down, so a context that counts for nothing would make throws end elsewhere.
    drag = learned.unscale(KeyRole.CONTEXT, context)[:, 0]
    off = np.linalg.norm(land(learned.unscale(KeyRole.PARAMETER, together.parameters), drag) - targets, axis=1)
    assert np.median(off) < 0.005


@pytest.mark.parametrize(("heights", "looks"), [((0.5,), 1), ((0.5, -0.5), 2)])
def test_the_dataset_is_carried_over_once_for_each_of_a_few_contexts(
    heights: tuple[float, ...], looks: int, targets: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    learned = learn_with_drag(role=KeyRole.CONTEXT)
    looked = []
    carry_over = LearnedMap.carry_over
    monkeypatch.setattr(
        LearnedMap, "carry_over", lambda self, context: looked.append(context) or carry_over(self, context)
    )
    many = np.concatenate([targets, targets])
    aim(learned, many, np.resize(heights, len(many))[:, np.newaxis])
    assert len(looked) == looks


@pytest.mark.parametrize("count", [1, 8, 48, 500, 900])
def test_the_nearest_throws_are_those_that_sorting_all_of_them_finds(count: int) -> None:
    # Rounded, so that many throws are at the same distance.
    squares = np.round(np.random.default_rng(0).random(500), 2)
    np.testing.assert_array_equal(find_nearest(squares, count), np.argsort(squares, kind="stable")[:count])


def test_aimed_parameters_stay_within_their_ranges(targets: np.ndarray) -> None:
    learned = learn(60)
    far = np.concatenate([targets, targets * 3])
    assert np.abs(throw(learned, far)[0].parameters).max() <= 1.0


def test_a_target_that_no_throw_came_near_is_out_of_reach() -> None:
    learned = learn()
    found = aim(learned, np.array([[9.0, 0.0], [1.3, -0.2]]), np.zeros((2, 0)))
    assert found.reachable.tolist() == [False, True]
    nearest = found.nearest_place[0]
    assert any(np.array_equal(nearest, place) for place in learned.outputs)
    assert np.linalg.norm(nearest - [9.0, 0.0]) == np.linalg.norm(learned.outputs - [9.0, 0.0], axis=1).min()


def test_aiming_takes_the_way_of_least_effort_if_chosen(targets: np.ndarray) -> None:
    learned = learn()
    by = {choice: throw(learned, targets, choice) for choice in Choice}
    assert all(off.max() < 0.01 for _, _, off in by.values())
    efforts = {choice: effort(values).mean() for choice, (_, values, _) in by.items()}
    assert efforts[Choice.LEAST_EFFORT] == min(efforts.values()) < efforts[Choice.NEAREST] - 0.005


def test_aiming_compensates_for_a_known_bias_and_offset(targets: np.ndarray) -> None:
    learned = learn()
    shifted = learned.correct(Correction(np.array([0.1, -0.2, 0.05]), np.zeros(0), np.array([0.03, -0.02])))
    found = aim(shifted, targets, np.zeros((len(targets), 0)))
    bias = np.array([0.1, -0.2, 0.05]) * (HIGH - LOW) / 2
    values = learned.unscale(KeyRole.PARAMETER, found.parameters) + bias
    off = np.linalg.norm(land(values) + np.array([0.03, -0.02]) - targets, axis=1)
    assert len(KEYS) == values.shape[1]
    assert off[found.reachable].max() < 0.004
    assert found.reachable.sum() > 25
