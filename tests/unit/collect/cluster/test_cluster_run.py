"""The progress of a dataset that is collected on a cluster."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.collect.cluster.cluster_run import ProgressOfSlices, SlicesState
from throwcollect.collect.coordinator import progress


@pytest.fixture
def run(tmp_path: Path) -> Any:
    """A run of 30 trials whose dataset is complete; three of them did not land."""
    pq.write_table(pa.table({"outcome": ["landed"] * 27 + ["not_released"] * 3}), tmp_path / "throws.parquet")
    return SimpleNamespace(
        directory=tmp_path,
        trials=30,
        config=SimpleNamespace(task=SimpleNamespace(success="landed", noun="throw"), cluster=SimpleNamespace(cores=1)),
    )


def test_the_speed_counts_only_trials_that_ended_since_the_first_look(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = iter([100.0, 100.0, 110.0])
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    shown = ProgressOfSlices(run)
    looks = [SlicesState(frozenset(), (), None, complete) for complete in (False, True)]
    assert [shown.at(look).throws_per_s for look in looks] == [0.0, 3.0]


def test_the_first_look_at_a_finished_dataset_counts_all_outcomes(run: Any) -> None:
    shown = ProgressOfSlices(run).at(SlicesState(frozenset(), (), None, complete=True))
    assert (shown.ended, shown.outcomes) == (30, {"landed": 27, "not_released": 3})


def test_refused_trials_are_not_counted(run: Any) -> None:
    outcomes = ["landed"] * 27 + ["refused"] * 2 + ["not_released"]
    pq.write_table(pa.table({"outcome": outcomes}), run.directory / "throws.parquet")
    shown = ProgressOfSlices(run).at(SlicesState(frozenset(), (), None, complete=True))
    assert (shown.ended, shown.failed) == (28, 1)
