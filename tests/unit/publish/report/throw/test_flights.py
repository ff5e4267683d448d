from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect.dataset.motion import Joint
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.figures import Points
from throwcollect.publish.report.measured import Outcomes
from throwcollect.publish.report.throw.flights import choose_examples, draw_joint, measure_residuals


def test_example_throws_have_an_episode_and_are_in_order_of_distance(collection: Any, tmp_path: Path) -> None:
    collection.refuse(5, "too fast")
    dataset = Dataset.open(collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 4, 6], lost=[2]))
    outcomes = Outcomes.of(dataset.throws["outcome"].to_pylist())
    landings = Points.read(dataset.throws, outcomes, "landing", None, "release_speed_mps")
    results = [collection.result(collection.episode(trial)) for trial in (0, 1, 3, 4, 6)]
    assert landings.trial.tolist() == [0, 1, 3, 4, 6]
    assert landings.x_m.tolist() == [result.landing.position[0] for result in results]
    assert landings.distance_m == pytest.approx([np.hypot(*result.landing.position[:2]) for result in results])
    nearest = landings.trial[np.argsort(landings.distance_m)].tolist()
    examples = choose_examples(dataset, landings, outcomes)
    assert list(examples) == nearest


def test_flights_of_a_sound_dataset_are_ballistic(collected: Path) -> None:
    residuals = measure_residuals(Dataset.open(collected))
    assert len(residuals) == 7
    assert residuals.max() < 1e-12


def test_a_kick_in_a_flight_shows_in_its_residual(collection: Any, tmp_path: Path) -> None:
    def kick(samples: Any, header: Any) -> Any:
        if header.trial == 3:
            samples.object_position[-5:, 0] += 1e-6
        return samples, header

    found = measure_residuals(Dataset.open(collection.collect(tmp_path / "dataset", change=kick)))
    assert (found > 1e-9).sum() == 1
    assert found[3] == pytest.approx(1e-6, rel=1e-3)


def test_a_joint_that_slides_is_drawn_in_millimetres_and_one_that_turns_in_degrees() -> None:
    position = np.array([0.0, 0.15])
    joint = Joint("torso_lift_joint", np.array([0.0, 1.0]), position, position, position)
    for factor, unit, title in ((1000.0, " mm", "position [mm]"), (math.degrees(1), "°", "position [°]")):
        figure = draw_joint(joint, position, None, (factor, unit))
        assert figure.layout.yaxis.title.text == title
        assert np.allclose(figure.data[0].y, factor * position, rtol=1e-6)
