from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect.dataset.reader import Dataset
from throwcollect.derive.derivation import filter_trials
from throwcollect.report.outcomes import Outcomes
from throwcollect.report.throw.measured import choose_examples, measure_residuals, read_landings
from throwcollect.report.throw.throw_sections import report_throws


def test_example_throws_have_an_episode_and_are_in_order_of_distance(collection: Any, tmp_path: Path) -> None:
    collection.refuse(5, "too fast")
    dataset = Dataset.open(collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 4, 6], lost=[2]))
    outcomes = Outcomes.of(dataset.throws["outcome"].to_pylist())
    landings = read_landings(dataset.throws, outcomes)
    results = [collection.result(collection.episode(trial)) for trial in (0, 1, 3, 4, 6)]
    assert landings.trial.tolist() == [0, 1, 3, 4, 6]
    assert landings.x_m.tolist() == [result.landing.position[0] for result in results]
    assert landings.distance_m == pytest.approx([np.hypot(*result.landing.position[:2]) for result in results])
    nearest = landings.trial[np.argsort(landings.distance_m)].tolist()
    examples = choose_examples(dataset, landings, outcomes)
    assert list(examples) == nearest


def test_flights_of_a_sound_dataset_are_ballistic(collected: Path) -> None:
    residuals = measure_residuals(Dataset.open(collected))
    assert (residuals.episodes, residuals.checked, len(residuals.distance_m)) == (7, 7, 7)
    assert residuals.distance_m.max() < 1e-12


def test_a_kick_in_a_flight_shows_in_its_residual(collection: Any, tmp_path: Path) -> None:
    def kick(samples: Any, header: Any) -> Any:
        if header.trial == 3:
            samples.ball_position[-5:, 0] += 1e-6
        return samples, header

    found = measure_residuals(Dataset.open(collection.collect(tmp_path / "dataset", change=kick)))
    assert (found.distance_m > 1e-9).sum() == 1
    assert found.distance_m[3] == pytest.approx(1e-6, rel=1e-3)


def test_the_report_on_a_derived_dataset_shows_throws_of_its_own_trials(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "some", where="trial in (4, 6)")
    dataset = Dataset.open(tmp_path / "some")
    report = report_throws(dataset, Outcomes.of(dataset["outcome"].tolist()))
    (examples, _) = report.episodes
    assert str(examples.blocks[1]).startswith(("Joints of trial 4: measured", "Joints of trial 6: measured"))
