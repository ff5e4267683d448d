"""What figures are drawn from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from throwcollect.dataset.journal import JournalLine
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.figures import draw_limit_boxes, draw_parameter_matrix, draw_throughput
from throwcollect.publish.report.measured import (
    Outcomes,
    SweptKey,
    choose_points,
    measure_times,
    read_parameters,
    summarise_peaks,
)


def parameters_of(directory: Path) -> tuple[SweptKey, ...]:
    dataset = Dataset.open(directory)
    outcomes = Outcomes.of(dataset.throws["outcome"].to_pylist())
    return read_parameters(dataset.config, dataset.throws, outcomes)


def test_the_values_of_a_swept_key_are_those_of_the_trials(collection: Any, tmp_path: Path) -> None:
    (parameter,) = parameters_of(collection.collect(tmp_path / "dataset", lost=[2]))
    assert (parameter.key, parameter.unit, parameter.counts.sum(axis=0).tolist()) == ("task.duration_s", "s", [6, 1])
    assert parameter.values.tolist() == [trial.values["task.duration_s"] for trial in collection.plan.trials]


def test_the_matrix_shows_each_trial_at_its_values_in_the_colour_of_its_outcome(
    make_collection: Any, tmp_path: Path
) -> None:
    swept = {"task.duration_s": {"min": 0.8, "max": 1.2}, "ball.mass_kg": {"min": 0.01, "max": 0.1, "scale": "log"}}
    settings = {"trials": 5, "sweep": {"sampler": "uniform", "parameters": swept}}
    dataset = Dataset.open(make_collection(settings).collect(tmp_path / "dataset", lost=[2]))
    outcomes = Outcomes.of(dataset["outcome"].tolist())
    landed, lost = draw_parameter_matrix(read_parameters(dataset.config, dataset.throws, outcomes), outcomes).data
    assert (landed.customdata.tolist(), lost.customdata.tolist()) == ([0, 1, 3, 4], [2])
    duration, mass = landed.dimensions
    assert (duration.label, mass.label) == ("duration_s<br>task [s]", "mass_kg<br>ball [kg]")
    assert mass.values == pytest.approx(dataset["ball_mass_kg"][[0, 1, 3, 4]], rel=1e-6)
    assert (duration.axis.type, mass.axis.type) == ("linear", "log")


def test_peaks_are_grouped_by_the_joint_that_had_them() -> None:
    throws = pa.table(
        {"effort_peak_share": [0.5, 0.7, 1.0, None, 0.9], "effort_peak_joint": ["a", "a", "b", None, "a"]}
    )
    peaks = summarise_peaks(throws, "effort")
    assert {joint: shares.tolist() for joint, shares in peaks.items()} == {"b": [1.0], "a": [0.5, 0.7, 0.9]}
    assert list(peaks) == ["b", "a"]
    boxes = draw_limit_boxes(peaks).data
    assert [box.name for box in boxes] == ["a<br>3 trials", "b<br>1 trial"]
    assert boxes[0].x == pytest.approx([0.5, 0.7, 0.9])


def test_the_chosen_points_are_reproducible_and_irregularly_spaced() -> None:
    assert choose_points(10, 20).tolist() == list(range(10))
    chosen = choose_points(100_000, 1000)
    assert np.array_equal(chosen, choose_points(100_000, 1000))
    assert len(set(chosen.tolist())) == 1000
    assert len(set(np.diff(chosen).tolist())) > 50


def test_throughput_leaves_pauses_out() -> None:
    events = [
        JournalLine("opened", 100.0),
        *(JournalLine("commit", 100.0 + i) for i in range(1, 11)),
        JournalLine("commit", 112.0),
        JournalLine("opened", 9000.0),
        *(JournalLine("commit", 9000.0 + i) for i in range(1, 9)),
    ]
    times, total_s = measure_times(events)
    assert (len(times["commit"]), total_s, times["opened"]) == (19, 20.0, [0.0, 12.0])
    figure = draw_throughput(times, total_s, "throw")
    (rates,) = figure.data
    assert (np.array(rates.y)[:-1] * np.diff(np.array(rates.x))).sum() == pytest.approx(19)
    assert [line.x0 for line in figure.layout.shapes] == [12.0]
    assert measure_times([])[0]["commit"] == []
    assert measure_times([JournalLine("commit", 5.0)]) == (
        {"commit": [0.0], "opened": []},
        0.0,
    )
