"""Throws at targets, by simulators in closed form."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.unit.learning.worlds import KEYS, TARGETS, land, learn

from throwcollect.config.schema import Config
from throwcollect.learning.adapting import Method
from throwcollect.learning.distilling import distil
from throwcollect.learning.score import Errors, Score
from throwcollect.learning.scoring import draw_targets, score_model, spread_first

SHIFT = np.array([0.1, 0.12])


class World:
    """Throws that end as `land` says, plus a shift; refuses fast throws and loses some others."""

    def __init__(self, shift: Any = (0.0, 0.0), *, refused_below_s: float = 0.0, lost_below_s: float = 0.0) -> None:
        self.config = Config()
        self.calls = 0
        self._shift = np.array(shift)
        self._refused, self._lost = refused_below_s, lost_below_s

    def find_refusal(self, values: Mapping[str, float]) -> str | None:
        return "too fast" if values[KEYS[0]] < self._refused else None

    def throw_many(self, points: Iterable[Mapping[str, float]], *, processes: int = 1) -> Iterator[Any]:
        self.calls += 1
        for point in points:
            assert self.find_refusal(point) is None
            place = (land(np.array([[point[key] for key in KEYS]])) + self._shift)[0]
            lost = point[KEYS[0]] < self._lost
            yield SimpleNamespace(
                outcome="self_hit" if lost else "landed", row=dict(zip(TARGETS, place.tolist(), strict=True))
            )


def score(world: World, other: World | None = None, *, seeds: range = range(1), scatter: float = 0.0) -> Score:
    options = {"count": 25, "distilled": None, "processes": 1}
    return score_model(learn(), world, seeds=seeds, world=other, scatter=scatter, **options)


def test_a_model_of_more_throws_hits_better() -> None:
    world = World()
    found = score(world)
    assert [each.trained_on for each in found.trained] == [30, 100, 300, 400]
    medians = [each.errors.median for each in found.trained]
    assert medians[0] > medians[1] > medians[-1]
    assert medians[-1] < 0.001
    assert world.calls == 1
    assert len(found.throws) == 25
    errors = [np.linalg.norm(np.subtract(each.place, each.target)) for each in found.throws]
    assert sorted(errors)[12] == pytest.approx(medians[-1])


def test_the_same_seed_gives_the_same_score() -> None:
    first = score(World())
    assert score(World()) == first
    assert score(World(), seeds=range(1, 2)).throws != first.throws


def test_throws_that_are_refused_or_do_not_land_are_counted_as_missed() -> None:
    both, refused = score(World(refused_below_s=0.95, lost_below_s=1.0)), score(World(refused_below_s=0.95))
    missed = [found.trained[-1].errors.missed for found in (both, refused)]
    assert 0 < missed[1] < missed[0] < 25
    assert missed == [sum(each.place is None for each in found.throws) for found in (both, refused)]
    errors = both.trained[-1].errors
    assert (errors.throws, errors.largest) == (25, None)


def test_adapting_to_another_world_by_a_few_throws_reduces_misses() -> None:
    found = score(World(), World(SHIFT))
    assert [each.real_throws for each in found.adapted] == [0, 1, 3, 5, 10]
    before, *after = (each.errors.median for each in found.adapted)
    assert before == pytest.approx(np.hypot(*SHIFT), rel=0.1)
    assert max(after) < before / 4
    assert found.adapted[0].method is Method.NONE
    assert len(found.adapted_throws) == found.adapted[0].errors.throws


def test_scoring_in_the_world_of_the_dataset_ignores_an_earlier_adaptation() -> None:
    learned = learn()
    shifted = learned.correct(replace(learned.correction, offset=SHIFT))
    options = {
        "count": 25,
        "seeds": range(1),
        "scatter": 0.0,
        "distilled": None,
        "processes": 1,
    }
    found = score_model(shifted, World(), world=World(SHIFT), **options)
    assert found.trained == score(World()).trained
    assert found.adapted[0].errors.median < 0.01


def test_a_world_in_which_no_target_can_be_reached_has_no_adapted_scores() -> None:
    assert score(World(), World((5.0, 0.0))).adapted == []


def test_drawn_targets_lie_near_landings_but_spread_more_evenly() -> None:
    landings = learn(800).outputs
    targets = draw_targets(landings, 200, 3)
    away = np.array([np.linalg.norm(landings - target, axis=1).min() for target in targets])
    assert away.max() < 0.05
    assert (targets != landings[:200]).all()
    # Cells with many landings get no more targets than others.
    share = (np.linalg.norm(targets - np.median(landings, axis=0), axis=1) > 0.4).mean()
    assert share > (np.linalg.norm(landings - np.median(landings, axis=0), axis=1) > 0.4).mean()


def test_targets_are_ordered_so_that_the_first_ones_are_far_apart() -> None:
    targets = np.array([[0.5, 0.0], [0.0, 0.0], [0.1, 0.0], [1.0, 0.0], [0.4, 0.6]])
    assert spread_first(targets).tolist() == targets[[0, 4, 1, 3, 2]].tolist()


def test_error_statistics_that_depend_on_a_throw_that_did_not_succeed_are_empty() -> None:
    found = Errors.of([np.array([[0.3], [-0.1], [np.nan], [0.2]])], ["landing_x_m"])
    assert (found.throws, found.missed, found.median, found.share90, found.largest) == (4, 1, 0.25, None, None)
    half = Errors.of([np.array([[0.3], [-0.1], [np.nan], [np.nan]])], ["landing_x_m"])
    assert (half.missed, half.median, half.largest) == (2, None, None)


def test_errors_in_metres_and_radians_are_summarised_separately() -> None:
    away = np.array([[0.5, 0.03, 0.04], [0.1, 0.0, 0.01], [-0.2, 0.3, 0.4]])
    found = Errors.of([away], ["hit_angle_rad", "landing_x_m", "landing_y_m"])
    lengths, angles = found.by_unit
    assert (lengths.unit, lengths.median, lengths.largest) == ("m", pytest.approx(0.05), pytest.approx(0.5))
    assert (angles.unit, angles.median, angles.largest) == ("rad", 0.2, 0.5)
    assert Errors.of([away, away], ["hit_angle_rad", "landing_x_m", "landing_y_m"]) == found.model_copy(
        update={"throws": 6}
    )
    assert found.cells[:3] == ("5.00 cm, 11.46°", "41.00 cm, 25.21°", "50.00 cm, 28.65°")
    assert Errors.of([away[:, :1]], ["landing_time_s"]).cells[2] == "0.5 s"


def test_a_distilled_map_is_scored_at_the_same_targets() -> None:
    learned, world = learn(), World()
    options = {"count": 25, "seeds": range(1), "scatter": 0.0, "processes": 1}
    found = score_model(learned, world, world=None, distilled=distil(learned), **options)
    assert world.calls == 1
    assert (found.trained, found.throws) == (score(World()).trained, score(World()).throws)
    assert found.distilled.throws == 25
    assert found.trained[-1].errors.median < found.distilled.median < 0.02


def test_scores_of_several_seeds_are_medians() -> None:
    some = [score(World(), World(SHIFT), seeds=range(seed, seed + 1)) for seed in range(3)]
    found = score(World(), World(SHIFT), seeds=range(3))
    assert (found.seed, found.seeds, found.targets, len(found.throws)) == (0, 3, 25, 75)
    for at, each in enumerate(found.trained):
        assert each.errors.median == sorted(one.trained[at].errors.median for one in some)[1]
        assert each.errors.throws == 75
    assert [each.real_throws for each in found.adapted] == [0, 1, 3, 5, 10]
    assert found.adapted[-1].errors.median == sorted(one.adapted[-1].errors.median for one in some)[1]
    assert some[0].trained[0] != some[1].trained[0]


def test_seeds_without_a_throw_that_succeeded_count_as_farther_than_all_others() -> None:
    missed, near, far = (np.array([[number]]) for number in (np.nan, 0.1, 0.3))
    assert Errors.of([missed, missed, near], TARGETS[:1]).median is None
    assert Errors.of([near, far], TARGETS[:1]).median == pytest.approx(0.2)
