"""What is told of a dataset on a cluster while it is followed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.cluster import cluster_run
from throwcollect.cluster.cluster_run import ProgressOfSlices, SlicesLook


@pytest.fixture
def run(tmp_path: Path) -> Any:
    """A run of 30 trials whose dataset is complete; three of them did not land."""
    pq.write_table(pa.table({"outcome": ["landed"] * 27 + ["not_released"] * 3}), tmp_path / "throws.parquet")
    return SimpleNamespace(
        directory=tmp_path,
        trials=30,
        simulations_per_task=1,
        submission=SimpleNamespace(live=False),
        config=SimpleNamespace(task=SimpleNamespace(success="landed", noun="throw")),
    )


def test_the_speed_is_that_of_the_trials_which_ended_while_one_looked(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = iter([100.0, 110.0])
    monkeypatch.setattr(cluster_run, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    progress = ProgressOfSlices(run)
    looks = [SlicesLook(frozenset(), (), None, complete) for complete in (False, True)]
    assert [progress.at(look).throws_per_s for look in looks] == [0.0, 3.0]


def test_whoever_first_looks_at_a_finished_dataset_is_told_what_came_of_its_trials(run: Any) -> None:
    progress = ProgressOfSlices(run).at(SlicesLook(frozenset(), (), None, complete=True))
    assert (progress.ended, progress.outcomes) == (30, {"landed": 27, "not_released": 3})
