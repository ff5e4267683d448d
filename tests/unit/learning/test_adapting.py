"""Adapting to worlds in closed form that differ from the one that was learned."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.learning.worlds import KEYS, draw, land, learn, learn_with_drag

from throwcollect.learning.adapting import Method, adapt
from throwcollect.learning.learned_map import KeyRole, LearnedMap

BIAS = np.array([0.02, 0.06, -0.04])
OFFSET = np.array([0.08, -0.05])


def elsewhere(
    learned: LearnedMap, count: int, world, *, noise_m: float = 0.0, seed: int = 3, **options
) -> SimpleNamespace:
    """Adapt by some throws in another world."""
    values = draw(count, seed)
    places = world(values) + noise_m * np.random.default_rng(seed).standard_normal((count, 2))
    inputs = learned.scale(KeyRole.PARAMETER, values)
    correction, found = adapt(learned, inputs, np.zeros((count, 0)), places, scatter=noise_m, **options)
    return SimpleNamespace(**dict(found), correction=correction)


def off(learned: LearnedMap, found: SimpleNamespace, world) -> float:
    """Median distance of new throws from where the adapted map has them."""
    values = draw(50, seed=11)
    predicted = learned.correct(found.correction).predict_ends(
        learned.scale(KeyRole.PARAMETER, values), np.zeros((50, 0))
    )
    return float(np.median(np.linalg.norm(predicted - world(values), axis=1)))


def land_shifted(values):
    return land(values) + OFFSET


def land_biased(values):
    return land(values + BIAS)


def heavy_drag(values):
    return land(values, 0.8)


def test_a_single_throw_reveals_the_offset_of_all_landings() -> None:
    learned = learn()
    found = elsewhere(learned, 1, land_shifted)
    assert found.method is Method.OFFSET
    assert found.correction.offset == pytest.approx(OFFSET, abs=0.005)
    assert off(learned, found, land_shifted) < 0.005 < found.before[0]


def test_eight_throws_reveal_a_bias_of_the_parameters() -> None:
    learned = learn()
    found = elsewhere(learned, 8, land_biased)
    half = np.array([0.2, 0.4, 0.3])
    assert found.method is Method.BIAS
    assert found.correction.bias * half == pytest.approx(BIAS, abs=0.02)
    assert off(learned, found, land_biased) < 0.004
    assert np.median(found.after) < 0.01 < np.median(found.before)
    assert len(found.found) == len(KEYS) + 2


def test_adapting_finds_the_value_of_a_latent_that_matters() -> None:
    learned = learn_with_drag()
    found = elsewhere(learned, 4, heavy_drag)
    assert found.method is Method.LATENT
    assert learned.unscale(KeyRole.LATENT, found.correction.latents) == pytest.approx([0.8], abs=0.1)
    assert off(learned, found, heavy_drag) < 0.01


def test_adapting_keeps_a_latent_within_its_collected_range() -> None:
    found = elsewhere(learn_with_drag(), 4, lambda values: land(values, 1.6), method=Method.LATENT)
    assert found.correction.latents.tolist() == [1.0]


@pytest.mark.parametrize(("count", "most_m"), [(1, 0.02), (3, 0.008), (5, 0.008), (10, 0.008)])
def test_adapting_to_an_unchanged_world_hardly_worsens_predictions(count: int, most_m: float) -> None:
    learned = learn()
    for seed in range(5):
        found = elsewhere(learned, count, land, noise_m=0.005, seed=seed)
        assert off(learned, found, land) < most_m


def test_adapting_to_a_throw_that_agrees_leaves_the_map_unchanged() -> None:
    learned = learn()
    found = elsewhere(learned, 1, land, noise_m=0.001, seed=1)
    assert found.method is Method.NONE
    assert found.correction is learned.correction


def test_adapting_to_scattered_throws_gets_better_with_more_throws() -> None:
    learned = learn()
    errors = [
        np.median(
            [
                off(learned, elsewhere(learned, count, land_biased, noise_m=0.02, seed=seed), land_biased)
                for seed in range(8)
            ]
        )
        for count in (3, 20)
    ]
    assert errors[1] < errors[0] < off(learned, elsewhere(learned, 3, land_biased, method=Method.NONE), land_biased)


def test_adapting_to_many_throws_reduces_their_errors_and_lists_every_one() -> None:
    found = elsewhere(learn(), 60, land_biased)
    assert len(found.after) == 60
    assert np.median(found.after) < 0.004 < np.median(found.before)


def test_a_requested_method_is_used_even_if_the_world_is_unchanged() -> None:
    assert elsewhere(learn(), 5, land, method=Method.OFFSET).method is Method.OFFSET


@pytest.mark.parametrize("count", [1, 3, 5, 10])
def test_scatter_is_hardly_ever_mistaken_for_a_different_world(count: int) -> None:
    found = [elsewhere(learn(), count, land, noise_m=0.02, seed=seed).method for seed in range(12)]
    assert found.count(Method.NONE) >= 11
