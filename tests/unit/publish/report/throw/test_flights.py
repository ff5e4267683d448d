from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.throw.flights import measure_residuals


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
