"""Throws that are spread over landing targets."""

import math
import subprocess
import sys
from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from tests.unit.sweep.own_plan import make_plan
from tests.unit.sweep.thrower import DISTANCE, HIT_ANGLE, PARAMETERS, TARGET, collect, configuration, throw

from throwcollect.config.sweep import TargetConfig
from throwcollect.sweep.target_cells import CellChooser, Cells
from throwcollect.sweep.trials import Trial, Trials
from throwcollect.tasks.measures import BallState
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

TRIALS = 960


def counts(trials: Iterable[Trial], target: dict[str, object] = TARGET) -> NDArray[np.int64]:
    """Number of throws that landed in each cell."""
    cells = Cells(TargetConfig.model_validate(target))
    places = [
        cells.place(trial.values, result) for trial in trials if (result := throw(trial)).outcome is ThrowOutcome.LANDED
    ]
    found = cells.cells_of(np.array(places))
    return np.bincount(found[found >= 0], minlength=cells.count)


def evenness(counted: NDArray[np.int64]) -> float:
    """Entropy over that of as many throws in each cell."""
    shares = counted[counted > 0] / counted.sum()
    return float(-(shares * np.log(shares)).sum() / math.log(len(counted)))


@pytest.fixture(scope="module")
def spread() -> list[Trial]:
    return collect(configuration(trials=TRIALS))


@pytest.fixture(scope="module")
def even_parameters() -> Trials:
    return make_plan(configuration(trials=6000, target=None)).trials


@pytest.fixture(scope="module")
def reachable(even_parameters: Trials) -> NDArray[np.bool_]:
    return counts(even_parameters) > 0


def test_throws_are_spread_far_more_evenly_than_by_sobol(
    spread: list[Trial], even_parameters: Trials, reachable: NDArray[np.bool_]
) -> None:
    ours, sobol = (counts(trials)[reachable] for trials in (spread, even_parameters[:TRIALS]))
    assert evenness(sobol) < 0.82
    assert evenness(ours) > 0.97
    assert np.count_nonzero(sobol == 0) > 5
    assert ours.min() >= 1
    assert np.percentile(ours, 10) >= 8
    assert ours.sum() > 1.25 * sobol.sum(), "throws beyond the targets are of no use"


def test_cells_out_of_reach_do_not_eat_the_budget(reachable: NDArray[np.bool_]) -> None:
    wide = {"distance_m": {"min": 0.5, "max": 8.1, "bins": 48}, "hit_angle_rad": HIT_ANGLE}
    near = np.zeros((48, 8), dtype=bool)
    near[:12] = reachable.reshape(12, 8)
    assert near.mean() < 0.2
    trials = collect(configuration(trials=TRIALS, target=wide))
    assert evenness(counts(trials, wide)[near.ravel()]) > 0.93


def test_throws_at_the_same_cells_differ_in_their_parameters(spread: list[Trial]) -> None:
    keys = [key for key, declared in PARAMETERS.items() if "scale" not in declared]
    low, high = (np.array([PARAMETERS[key][end] for key in keys]) for end in ("min", "max"))
    chosen = np.array([[trial.values[key] for key in keys] for trial in spread if throw(trial).landing])
    distances, _ = cKDTree((chosen - low) / (high - low)).query((chosen - low) / (high - low), 2)
    assert np.median(distances[:, 1]) > 0.06


def test_throws_are_spread_over_heights_as_well() -> None:
    target = {"distance_m": {**DISTANCE, "bins": 6}, "height_m": {"min": 0.0, "max": 0.5, "bins": 4}}
    counted = counts(collect(configuration(trials=512, target=target)), target).reshape(6, 4)
    sobol = counts(make_plan(configuration(trials=512, target=None)).trials, target).reshape(6, 4)
    assert evenness(counted.ravel()) > 0.97 > evenness(sobol.ravel())
    assert counted.min() > 2 * sobol.min()


def test_lists_of_values_and_fixed_ranges_can_be_swept_as_well() -> None:
    parameters = {
        **PARAMETERS,
        "ball.friction": {"values": [0.1, 0.4, 0.9]},
        "scene.landing_height_m": {"min": 0.2, "max": 0.2},
    }
    config = configuration(trials=320, target={"distance_m": DISTANCE}, parameters=parameters)
    trials = collect(config)
    assert {trial.values["ball.friction"] for trial in trials[128:]} == {0.1, 0.4, 0.9}
    assert {trial.values["scene.landing_height_m"] for trial in trials} == {0.2}


def test_trials_stay_within_their_ranges(spread: list[Trial]) -> None:
    for key, declared in PARAMETERS.items():
        values = [trial.values[key] for trial in spread]
        assert declared["min"] <= min(values)
        assert max(values) <= declared["max"]


def test_rounds_stay_sobol_while_almost_no_throw_lands() -> None:
    config = configuration(trials=320)

    def unlucky(trial: Trial) -> ThrowResult:
        return throw(trial) if trial.number < 5 else ThrowResult(ThrowOutcome.RECAUGHT)

    sobol = make_plan(configuration(trials=320, target=None)).trials
    assert collect(config, throw=unlucky) == list(sobol)


def test_another_seed_gives_other_trials(spread: list[Trial]) -> None:
    config = configuration(trials=192)
    assert collect(config)[128:] == spread[128:192]
    other = collect(config.model_copy(update={"seed": 2}))
    assert not {trial.digest for trial in other} & {trial.digest for trial in spread}


def test_another_process_draws_the_same_trials(spread: list[Trial]) -> None:
    script = (
        "from tests.unit.sweep.thrower import collect, configuration\n"
        "print(collect(configuration(trials=192))[-1].digest)"
    )
    printed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == spread[191].digest


CELLS = Cells(TargetConfig.model_validate({"distance_m": {"min": 1, "max": 3, "bins": 4}, "hit_angle_rad": HIT_ANGLE}))


def test_a_landing_has_a_place_by_distance_and_hit_angle_in_units_of_bins() -> None:
    trial = make_plan(configuration()).trials[0]
    result = throw(trial)
    assert result.landing is not None
    assert result.hit_angle_rad is not None
    x, y, _ = result.landing.position
    expected = [(math.hypot(x, y) - 1) / 0.5, (result.hit_angle_rad - 0.9) / 0.075]
    assert CELLS.place(trial.values, result) == pytest.approx(expected)
    assert np.isnan(CELLS.place(trial.values, ThrowResult(ThrowOutcome.TIMEOUT))).all()


def test_the_outermost_bins_include_their_outer_ends() -> None:
    places = np.array([[0.0, 0.0], [4.0, 8.0], [3.99, 0.0], [4.01, 0.0], [-1e-9, 0.0], [np.nan, np.nan]])
    assert CELLS.cells_of(places).tolist() == [0, 31, 24, -1, -1, -1]
    assert CELLS.corners(np.array([0, 31])).tolist() == [[0, 0], [3, 7]]


def make_chooser(**known: list[int]) -> CellChooser:
    each = {name: np.array(known.get(name, [0, 0, 0, 0])) for name in ("landed", "asked", "missed", "away")}
    return CellChooser(**each, randomness=np.random.default_rng(0))


def choose(count: int, **known: list[int]) -> list[int]:
    return make_chooser(**known).take(count).tolist()


def test_the_thinnest_cells_come_first_and_throws_under_way_count() -> None:
    assert choose(1, landed=[3, 0, 1, 3]) == [1]
    assert sorted(choose(2, landed=[3, 0, 1, 3], asked=[0, 1, 0, 0])) == [1, 2]
    assert choose(3, landed=[3, 0, 3, 3]) == [1, 1, 1]
    assert 1 not in choose(3, landed=[3, 0, 3, 3], asked=[0, 9, 0, 0])


def test_each_further_miss_of_a_cell_doubles_its_wait() -> None:
    assert 0 in choose(4, missed=[1, 0, 0, 0])
    assert 0 not in choose(20, missed=[4, 0, 0, 0])
    assert 0 in choose(3 * 7 + 4, missed=[4, 0, 0, 0])
    assert 0 not in choose(1000, missed=[2000, 0, 0, 0])


def test_cells_at_the_edge_of_reach_come_before_cells_beyond() -> None:
    assert sorted(choose(3, away=[1, 5, 0, 1])) == [0, 2, 3]


def test_a_cell_that_is_given_back_waits_as_if_missed_four_times_and_is_given_back_once() -> None:
    chooser = make_chooser(landed=[0, 2, 2, 2])
    assert chooser.take(2).tolist() == [0, 0]
    assert chooser.give_back(np.array([0, 0])).tolist() == [True, True]
    taken = chooser.take(3 * 5 + 4).tolist()
    assert taken.count(0) == 1
    assert taken.index(0) >= 3 * 5
    assert chooser.give_back(np.array([0, 1])).tolist() == [False, True]


def test_rounds_that_run_at_the_same_time_do_not_throw_at_the_same_cells() -> None:
    line = {"distance_m": {"min": 1.0, "max": 2.0, "bins": 160}}

    def straight(trial: Trial) -> ThrowResult:
        landing = BallState(1.0, (1.0 + trial.values["ball.friction"], 0.0, 0.0), (1.0, 0.0, -1.0))
        return ThrowResult(ThrowOutcome.LANDED, landing=landing, hit_angle_rad=0.785)

    cells = Cells(TargetConfig.model_validate(line))
    trials = collect(configuration(trials=256, target=line), throw=straight)
    found = cells.cells_of(np.array([cells.place(trial.values, straight(trial)) for trial in trials]))
    assert len(set(found[128:192]) & set(found[192:])) < 20
