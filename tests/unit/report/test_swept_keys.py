from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect.dataset.reader import Dataset
from throwcollect.report.outcomes import Outcomes
from throwcollect.report.swept_keys import SweptKey, read_parameters


def parameters_of(directory: Path) -> tuple[SweptKey, ...]:
    dataset = Dataset.open(directory)
    outcomes = Outcomes.of(dataset.throws["outcome"].to_pylist())
    return read_parameters(dataset.config, dataset.throws, outcomes)


def test_the_values_of_a_swept_key_are_those_of_the_trials(collection: Any, tmp_path: Path) -> None:
    (parameter,) = parameters_of(collection.collect(tmp_path / "dataset", lost=[2]))
    assert (parameter.key, parameter.unit, parameter.counts.sum(axis=0).tolist()) == ("task.duration_s", "s", [6, 1])
    assert parameter.values.tolist() == [trial.values["task.duration_s"] for trial in collection.plan.trials]


def test_few_distinct_values_of_a_key_get_a_bin_each(make_collection: Any, tmp_path: Path) -> None:
    parameters = {
        "task.duration_s": {"values": [0.8, 1.0]},
        "ball.mass_kg": {"min": 0.01, "max": 0.1, "scale": "log"},
    }
    collection = make_collection({"trials": 20, "sweep": {"sampler": "sobol", "parameters": parameters}})
    directory = collection.collect(tmp_path / "dataset", lost=range(20))
    duration, mass = parameters_of(directory)
    assert duration.steps is not None
    assert duration.steps.tolist() == [0.8, 1.0]
    assert duration.counts.sum(axis=1).tolist() == [(duration.values == 0.8).sum(), (duration.values == 1.0).sum()]
    assert duration.edges == pytest.approx([0.7, 0.9, 1.1])
    assert mass.logarithmic
    assert mass.edges[[0, 6, 12]] == pytest.approx([0.01, 10**-1.5, 0.1])
    assert mass.counts[:, 0].tolist() == np.histogram(mass.values, mass.edges)[0].tolist()
