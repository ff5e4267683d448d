from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect.dataset.reader import Dataset
from throwcollect.derive.derivation import filter_trials
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.report.figures import Points
from throwcollect.report.outcomes import SUCCESS, Outcomes
from throwcollect.report.throw.flights import choose_examples, measure_residuals
from throwcollect.report.throw.throw_sections import report_throws
from throwcollect.tasks.throw_into.into_result import IntoOutcome


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
    assert (residuals.episodes, residuals.checked, len(residuals.distance_m)) == (7, 7, 7)
    assert residuals.distance_m.max() < 1e-12


def test_a_kick_in_a_flight_shows_in_its_residual(collection: Any, tmp_path: Path) -> None:
    def kick(samples: Any, header: Any) -> Any:
        if header.trial == 3:
            samples.object_position[-5:, 0] += 1e-6
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


def rest_in_bin(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The balls of even trials rest in the bin."""
    if header.trial % 2:
        return samples, header
    samples.object_position[-1], samples.object_linear_velocity[-1] = (1.6, -0.25, 0.05), 0.0
    return samples, replace(header, end_reason="rest")


def test_a_report_on_throws_into_a_bin_shows_the_bin_and_which_throws_stayed_in_it(
    make_collection: Any, tmp_path: Path
) -> None:
    swept = {"task.bin.y_m": {"values": [-0.2, -0.3, 9.0]}, "task.duration_s": {"values": [0.9, 1.0]}}
    pole = {"shape": "cylinder", "position_m": [1, 2, 0.5], "radius_m": 0.1, "length_m": 1, "color": "#3f6fb0"}
    settings = {
        "trials": None,
        "task": {"name": "throw_into"},
        "scene": {"bodies": {"pole": pole}},
        "sweep": {"sampler": "grid", "parameters": swept},
    }
    dataset = Dataset.open(make_collection(settings).collect(tmp_path / "a", change=rest_in_bin))
    outcomes = Outcomes.of(dataset["outcome"].tolist(), list(IntoOutcome))
    assert outcomes.counts["in_bin"] == 2
    report = report_throws(dataset, outcomes)
    assert [tile.label for tile in report.tiles] == ["landing distance", "release speed"]
    landing, _ = report.results
    assert landing.text.startswith(
        "2 of 6 throws stayed in the bin; the balls crossed the plane of the rim at z = 0.25 m"
    )
    (above, *_), (side, top) = landing.blocks[0], report.episodes[0].blocks[0]
    assert above.text == "Bodies differ from throw to throw; those of a few throws are drawn."
    for panel, column in ((above, 1), (side, 2), (top, 1)):
        drawn = [trace for trace in panel.figure.data if trace.fill == "toself"]
        # Outlines lie behind everything else.
        assert drawn == list(panel.figure.data[: len(drawn)])
        assert [trace.name for trace in drawn].count("pole") == 1
        assert [trace.name for trace in drawn].count("bin_floor") == 3
        (pole_drawn,) = (trace for trace in drawn if trace.name == "pole")
        assert (max(pole_drawn.x), max(pole_drawn.y)) == pytest.approx((1.1, 2.1 if column == 1 else 1.0), abs=1e-3)
        assert pole_drawn.fillcolor == "rgba(63, 111, 176, 0.200)"
    legend = {trace.name: trace.marker.color for trace in above.figure.data if trace.showlegend is not False}
    assert legend["in bin"] == SUCCESS.colour
