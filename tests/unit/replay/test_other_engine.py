"""How much columns differ if another engine simulates the throws, and which engines can be chosen."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from throwcollect import progress_log
from throwcollect.dataset.reader import Dataset
from throwcollect.replay import Deviation, Distribution, distributions, simulate_with
from throwcollect.simulator import Simulator


def test_a_distribution_covers_only_values_that_both_throws_have() -> None:
    found = distributions(
        [
            Deviation(0, "landed", "landed", {"landing_x_m": 0.003, "apex_z_m": 0.0}),
            Deviation(2, "landed", "landed", {"landing_x_m": -0.004, "apex_z_m": 0.0}),
            Deviation(3, "landed", "dropped", {"apex_z_m": 3.0}),
        ]
    )
    assert found == [
        Distribution(
            "landing_x_m", 2, pytest.approx(-0.0005), pytest.approx(0.0125**0.5 * 0.0316227766), 0.0035, 0.004
        ),
        Distribution("apex_z_m", 3, 1.0, pytest.approx(3**0.5), 0.0, 3.0),
    ]


def test_deviations_are_those_of_the_rows_of_both_engines(dataset: Path) -> None:
    found = list(simulate_with(dataset, "ballistic", [4, 1]))
    assert [each.trial for each in found] == [4, 1]
    stored = {row["trial"]: row for row in Dataset.open(dataset).throws.to_pylist()}
    with Simulator(dataset / "config.yaml", overrides=["sim.engine=ballistic"]) as simulator:
        for each in found:
            row = stored[each.trial]
            again = simulator.throw({"task.duration_s": row["task_duration_s"]})
            assert (each.stored, each.again) == (row["outcome"], again.outcome)
            for column in ("release_speed_mps", "flight_time_s", "landing_x_m"):
                assert each.values[column] == pytest.approx(again.row[column] - row[column], abs=1e-12)
            assert not each.values.keys() & {"trial", "outcome", "task.duration_s"}


def test_throws_that_are_simulated_again_are_counted(
    dataset: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_log, "_EVERY_S", 0.0)
    with caplog.at_level(logging.INFO, logger=progress_log.LOGGER):
        list(simulate_with(dataset, "ballistic", [4, 1]))
    assert caplog.messages == ["1 of 2 throws simulated"]
