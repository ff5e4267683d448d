from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from throwcollect.config.sweep import TargetConfig
from throwcollect.dataset.directory import JOURNAL
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import REFUSED
from throwcollect.report.coverage import coverage
from throwcollect.report.dataset_facts import gather
from throwcollect.report.episodes import residuals
from throwcollect.report.failures import Failure, failures
from throwcollect.report.landing import Landings
from throwcollect.report.limits import joint_peaks
from throwcollect.report.outcomes import Outcomes, style_of
from throwcollect.report.thinning import thinned
from throwcollect.report.throughput import throughput
from throwcollect.tasks.outcome import Outcome


def landed(distance: list[float], angle: list[float]) -> Landings:
    count, zero = len(distance), np.zeros(len(distance))
    trials = np.arange(count)
    return Landings(trials, np.array(distance), zero, np.array(distance), np.array(angle), zero, zero, trials * 0)


def test_facts_are_those_of_the_trials(collection: Any, tmp_path: Path) -> None:
    collection.refuse(5, "too fast")
    directory = collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 4, 6], lost=[2])
    facts = gather(Dataset.open(directory))
    assert facts.outcomes.counts == {"landed": 5, "lost": 1, "refused": 1}
    results = [collection.result(collection.episode(trial)) for trial in (0, 1, 3, 4, 6)]
    assert facts.landings.trial.tolist() == [0, 1, 3, 4, 6]
    assert facts.landings.x_m.tolist() == [result.landing.position[0] for result in results]
    assert facts.landings.distance_m == pytest.approx([np.hypot(*result.landing.position[:2]) for result in results])
    assert facts.failures == (
        Failure("lost", "two simulations were lost", 1, (2,)),
        Failure("refused", "too fast", 1, (5,)),
    )
    (parameter,) = facts.parameters
    assert (parameter.key, parameter.unit, parameter.counts.sum()) == ("task.duration_s", "s", 7)
    assert parameter.values.tolist() == [trial.values["task.duration_s"] for trial in collection.plan.trials]
    assert (facts.residuals.episodes, facts.residuals.checked) == (5, 5)
    assert facts.residuals.distance_m.max() < 1e-12
    nearest = facts.landings.trial[np.argsort(facts.landings.distance_m)].tolist()
    assert [path.trial for path in facts.paths] == nearest
    assert facts.motion is not None
    assert facts.motion.trial == nearest[2]
    assert np.abs(facts.motion.measured - facts.motion.commanded).max() < 1e-9


def test_few_distinct_values_get_a_bin_each(make_collection: Any, tmp_path: Path) -> None:
    parameters = {
        "task.duration_s": {"values": [0.8, 1.0]},
        "ball.mass_kg": {"min": 0.01, "max": 0.1, "scale": "log"},
    }
    collection = make_collection({"trials": 20, "sweep": {"sampler": "sobol", "parameters": parameters}})
    directory = collection.collect(tmp_path / "dataset", lost=range(20))
    duration, mass = gather(Dataset.open(directory)).parameters
    assert duration.steps is not None
    assert duration.steps.tolist() == [0.8, 1.0]
    assert duration.counts.sum(axis=1).tolist() == [(duration.values == 0.8).sum(), (duration.values == 1.0).sum()]
    assert duration.edges == pytest.approx([0.7, 0.9, 1.1])
    assert mass.logarithmic
    assert mass.edges[[0, 6, 12]] == pytest.approx([0.01, 10**-1.5, 0.1])
    assert mass.counts[:, 0].tolist() == np.histogram(mass.values, mass.edges)[0].tolist()


def test_reasons_that_differ_in_numbers_are_one() -> None:
    rows = [
        (0, "landed", None),
        (1, "refused", "arm_right_4_joint needs 12.5 Nm at 0.3 s"),
        (2, "self_hit", "the ball touched arm_right_7_link at 0.812 s"),
        (3, "refused", "arm_right_4_joint needs 14 Nm at -1e-3 s"),
    ]
    assert failures(rows) == (
        Failure("refused", "arm_right_4_joint needs # Nm at # s", 2, (1, 3)),
        Failure("self_hit", "the ball touched arm_right_7_link at 0.812 s", 1, (2,)),
    )


def test_cells_are_those_of_the_targets() -> None:
    target = TargetConfig.model_validate(
        {
            "distance_m": {"min": 1, "max": 2, "bins": 2},
            "height_m": {"min": 0, "max": 1, "bins": 2},
            "hit_angle_rad": {"min": 0, "max": 1, "bins": 1},
        }
    )
    throws = pa.table({"scene.landing_height_m": [0.2, 0.7, 1.0, 0.1]})
    found = coverage(landed([1.2, 1.2, 2.0, 2.1], [0.5, 0.5, 1.0, 0.5]), throws, target=target)
    assert found is not None
    assert found.counts.tolist() == [[[1, 1]], [[0, 1]]]  # distance, hit angle, height
    assert (found.hit, found.throws, found.counts.size) == (3, 4, 4)
    assert [(first.label[:3], second.label[:3]) for first, second, _ in found.pairs] == [
        ("lan", "hit"),
        ("lan", "lan"),
        ("hit", "lan"),
    ]
    assert found.pairs[1][2].tolist() == [[1, 1], [0, 1]]
    assert found.pairs[2][2].tolist() == [[1, 2]]


def test_cells_without_targets_are_of_round_numbers() -> None:
    found = coverage(landed([1.0, 1.34, 2.4], [1.2, 1.21, 1.3]), pa.table({}), target=None)
    assert found is not None
    distance, angle = found.axes
    assert distance.edges == pytest.approx(np.arange(1.0, 2.5001 + 0.1, 0.1)[: len(distance.edges)])
    assert np.diff(angle.edges) == pytest.approx(0.01)
    assert found.counts.sum() == 3
    assert coverage(landed([], []), pa.table({}), target=None) is None


def test_peaks_are_grouped_by_the_joint_that_had_them() -> None:
    throws = pa.table(
        {"effort_peak_share": [0.5, 0.7, 1.0, None, 0.9], "effort_peak_joint": ["a", "a", "b", None, "a"]}
    )
    first, second = joint_peaks(throws, "effort")
    assert (first.joint, first.count, first.quartiles, first.reached) == ("b", 1, (1.0,) * 5, 1)
    assert (second.joint, second.count, second.reached) == ("a", 3, 0)
    assert second.quartiles == pytest.approx((0.5, 0.6, 0.7, 0.8, 0.9))


def test_throughput_leaves_pauses_out() -> None:
    events = [
        {"event": "opened", "time": 100.0},
        *({"event": "commit", "time": 100.0 + i} for i in range(1, 11)),
        {"event": "fail", "time": 112.0},
        {"event": "opened", "time": 9000.0},
        *({"event": "commit", "time": 9000.0 + i} for i in range(1, 9)),
    ]
    found = throughput(events)
    assert found is not None
    assert (found.commits, found.edges_s[-1], found.resumed_s) == (18, 20.0, (12.0,))
    assert found.troubles == {"fail": (12.0,), "lost": ()}
    assert (found.rate_per_s * np.diff(found.edges_s)).sum() == pytest.approx(18)
    assert throughput([]) is None
    assert throughput([{"event": "commit", "time": 5.0}]) is None


def test_a_choice_of_points_is_the_same_each_time_and_no_lattice() -> None:
    assert thinned(10, 20).tolist() == list(range(10))
    chosen = thinned(100_000, 1000)
    assert np.array_equal(chosen, thinned(100_000, 1000))
    assert len(set(chosen.tolist())) == 1000
    assert len(set(np.diff(chosen).tolist())) > 50


def test_residuals_are_computed_for_a_part_of_many_episodes(collected: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.report.episodes.MOST_RESIDUALS", 3)
    found = residuals(Dataset.open(collected))
    assert (found.episodes, found.checked, len(found.distance_m)) == (7, 3, 3)


def test_a_flight_with_a_kick_stands_out(collection: Any, tmp_path: Path) -> None:
    def kick(samples: Any, header: Any) -> Any:
        if header.trial == 3:
            samples.ball_position[-5:, 0] += 1e-6
        return samples, header

    found = residuals(Dataset.open(collection.collect(tmp_path / "dataset", change=kick)))
    assert (found.distance_m > 1e-9).sum() == 1
    assert found.distance_m[3] == pytest.approx(1e-6, rel=1e-3)


def test_outcomes_come_in_one_order_and_unknown_ones_last() -> None:
    found = Outcomes.of(["lost", "landed", "odd", "self_hit", "landed"])
    assert found.names == ("landed", "self_hit", "lost", "odd")
    assert found.codes.tolist() == [2, 0, 3, 1, 0]
    assert found.landed == 2
    assert found.are("landed").tolist() == [False, True, False, False, True]
    assert found.are("recaught").tolist() == [False] * 5


def test_the_journal_is_where_the_throughput_comes_from(dataset: Path) -> None:
    journal = dataset / JOURNAL
    journal.parent.mkdir(exist_ok=True)
    journal.write_text("".join(json.dumps({"event": "commit", "time": 10.0 + i}) + "\n" for i in range(11)))
    found = gather(Dataset.open(dataset)).throughput
    assert found is not None
    assert (found.commits, found.edges_s[-1]) == (11, 10.0)
    journal.unlink()
    assert gather(Dataset.open(dataset)).throughput is None


def test_every_outcome_is_drawn_in_a_way_of_its_own() -> None:
    styles = [style_of(name) for name in (*(outcome.value for outcome in Outcome), REFUSED, "unheard of")]
    for part in ("colour", "symbol", "marker"):
        assert len({getattr(style, part) for style in styles}) == len(styles)
