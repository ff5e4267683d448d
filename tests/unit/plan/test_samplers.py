import typing
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.schema import Config, Range, SweepConfig, Values
from throwcollect.errors import PlanError
from throwcollect.plan.samplers import UNIT_SAMPLERS, draw_points, spread

HERE = Path()
NAMES = sorted(UNIT_SAMPLERS)
KEYS = ["task.duration_s", "ball.mass_kg", "task.trajectory.gamma"]
bounds = st.tuples(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6)).map(sorted)
parameters = st.one_of(
    st.builds(
        lambda ends, scale: Range(min=ends[0], max=ends[1], scale=scale), bounds, st.sampled_from(["linear", "log"])
    ),
    st.builds(Values, values=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=5)),
)


def draw(parameters, *, sampler="sobol", trials=64, seed=0):
    config = Config(seed=seed, trials=trials, sweep=SweepConfig(sampler=sampler, parameters=parameters))
    return draw_points(config, directory=HERE).values


def test_the_configuration_names_these_samplers_and_two_more():
    named = typing.get_args(typing.get_type_hints(SweepConfig)["sampler"])
    assert {*NAMES, "grid", "list"} == set(named)


@settings(deadline=None, max_examples=30)
@given(
    st.lists(parameters, min_size=1, max_size=3), st.integers(1, 70), st.integers(0, 2**32 - 1), st.sampled_from(NAMES)
)
def test_drawn_values_lie_within_their_range_or_list(declared, trials, seed, sampler):
    values = draw(dict(zip(KEYS, declared, strict=False)), sampler=sampler, trials=trials, seed=seed)
    assert values.shape == (trials, len(declared))
    for parameter, column in zip(declared, values.T, strict=True):
        if isinstance(parameter, Range):
            assert ((parameter.min <= column) & (column <= parameter.max)).all()
        else:
            assert set(column) <= set(parameter.values)


SPREAD = {"task.duration_s": Range(min=1, max=3), "ball.mass_kg": Range(min=0.01, max=1, scale="log")}


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 300), st.integers(1, 300), st.sampled_from(["uniform", "sobol"]))
def test_drawing_more_points_keeps_the_earlier_ones(few, more, sampler):
    few, more = sorted((few, more))
    np.testing.assert_array_equal(
        draw(SPREAD, sampler=sampler, trials=more)[:few], draw(SPREAD, sampler=sampler, trials=few)
    )


@pytest.mark.parametrize("sampler", NAMES)
def test_points_depend_on_the_root_seed(sampler):
    np.testing.assert_array_equal(draw(SPREAD, sampler=sampler, seed=3), draw(SPREAD, sampler=sampler, seed=3))
    assert (draw(SPREAD, sampler=sampler, seed=3) != draw(SPREAD, sampler=sampler, seed=4)).all()


def test_sobol_puts_one_point_into_each_strip():
    strips = np.floor((draw(SPREAD, sampler="sobol", trials=32)[:, 0] - 1) / 2 * 32)
    assert sorted(strips) == list(range(32))


def test_values_of_a_list_get_equal_shares():
    column = draw({"ball.mass_kg": Values(values=[0.1, 0.2, 0.3, 0.4])}, sampler="sobol", trials=64)[:, 0]
    assert np.unique(column, return_counts=True)[1].tolist() == [16, 16, 16, 16]


def test_a_logarithmic_scale_spreads_the_logarithm():
    column = draw({"ball.mass_kg": Range(min=0.01, max=1, scale="log")}, trials=64)[:, 0]
    assert (column < 0.1).sum() == 32


@pytest.mark.parametrize("trials", [1, 3, 100])
def test_a_number_of_trials_that_is_no_power_of_two_causes_no_warning(trials):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(draw(SPREAD, trials=trials)) == trials


GRID = {
    "ball.mass_kg": Values(values=[0.3, 0.1]),
    "task.duration_s": Range(min=1, max=2, count=3),
    "task.trajectory.gamma": Range(min=1, max=100, scale="log", count=3),
}


def test_a_grid_holds_all_combinations_with_the_last_key_fastest():
    values = draw(GRID, sampler="grid", trials=None)
    assert len(values) == 18
    np.testing.assert_allclose(values[:4], [[0.3, 1, 1], [0.3, 1, 10], [0.3, 1, 100], [0.3, 1.5, 1]], rtol=1e-14)
    assert values[-1].tolist() == [0.1, 2.0, 100.0]


def test_trials_take_the_first_points_of_a_grid():
    np.testing.assert_array_equal(draw(GRID, sampler="grid", trials=5), draw(GRID, sampler="grid", trials=None)[:5])


def test_the_first_points_of_an_endless_grid_need_no_endless_memory():
    endless = {key: Range(min=1, max=2, count=10**6) for key in KEYS}
    assert draw(endless, sampler="grid", trials=2)[1].tolist() == [1, 1, 1 + 1 / (10**6 - 1)]
    with pytest.raises(
        PlanError, match=r"^sweep\.parameters: the grid has 1000000000000000000 points\n  expected: at most"
    ):
        draw(endless, sampler="grid", trials=None)


def test_the_first_points_of_a_grid_beyond_64_bits_can_be_drawn():
    endless = {f"ball.{key}": Range(min=0.01, max=0.02, count=10**7) for key in ("mass_kg", "radius_m", "friction")}
    assert draw(endless, sampler="grid", trials=2)[0].tolist() == [0.01, 0.01, 0.01]
    with pytest.raises(PlanError, match="the grid has 1000000000000000000000 points"):
        draw(endless, sampler="grid", trials=None)


def test_until_without_trials_draws_ten_times_as_many_points_as_should_land():
    sweep = SweepConfig(parameters=SPREAD)
    assert len(draw_points(Config(until={"landed": 30}, sweep=sweep), directory=HERE).values) == 300
    assert len(draw_points(Config(trials=40, until={"landed": 30}, sweep=sweep), directory=HERE).values) == 40


def test_a_place_of_1_gives_the_last_value_of_a_list():
    assert spread(Values(values=[2.0, 5.0]), np.array([0.0, 0.75, 1.0])).tolist() == [2.0, 5.0, 5.0]
