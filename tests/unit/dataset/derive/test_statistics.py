import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.dataset.derive.statistics import statistics
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.robots.talos import TALOS


def test_statistics_of_signals_cover_the_samples_of_all_episodes(collected: Path) -> None:
    found = statistics(collected)
    samples = [episode.samples() for episode in Dataset.open(collected).episodes()]
    assert (found.episodes, found.samples) == (7, sum(map(len, samples)))
    for group, attribute, names in (
        ("position_rad", "position", TALOS.joints),
        ("velocity_radps", "velocity", TALOS.joints),
        ("effort_nm", "effort", TALOS.joints),
        ("ball_position_m", "object_position", "xyz"),
        ("ball_velocity_mps", "object_linear_velocity", "xyz"),
    ):
        table = np.concatenate([getattr(each, attribute) for each in samples])
        assert list(found.signals[group]) == list(names)
        for signal, column in zip(found.signals[group].values(), table.T, strict=True):
            assert (signal.min, signal.max) == (column.min(), column.max())
            assert signal.mean == pytest.approx(column.mean(), rel=1e-12, abs=1e-12)
            assert signal.std == pytest.approx(column.std(), rel=1e-9, abs=1e-12)
    # A program that normalises recognises a constant signal by a deviation of exactly 0.
    assert found.signals["position_rad"]["leg_left_4_joint"].std == 0


def test_statistics_of_columns_leave_out_empty_cells(collection: Collection, tmp_path: Path) -> None:
    collection.collect(tmp_path / "dataset", lost=[2, 3])
    found = statistics(tmp_path / "dataset")
    landings = [x for x in Dataset.open(tmp_path / "dataset").throws["landing_x_m"].to_pylist() if x is not None]
    column = found.columns["landing_x_m"]
    assert found.outcomes == {"landed": 5, "lost": 2}
    assert (column.count, column.nulls) == (5, 2)
    assert (column.min, column.max) == (min(landings), max(landings))
    assert column.mean == pytest.approx(np.mean(landings))
    assert column.std == pytest.approx(np.std(landings))
    assert column.quantiles["q50"] == np.median(landings)
    assert found.columns["task_duration_s"].count == 7
    assert not {"trial", "chunk_offset", "outcome", "digest"} & set(found.columns)


def test_statistics_count_and_leave_out_samples_that_are_not_finite(collection: Collection, tmp_path: Path) -> None:
    def spoil_efforts(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        if header.trial != 1:
            return samples, header
        effort = samples.effort.copy()
        effort[5:8, 3] = np.nan
        return replace(samples, effort=effort), header

    collection.collect(tmp_path / "dataset", change=spoil_efforts)
    found = statistics(tmp_path / "dataset")
    assert found.samples_not_finite == 3
    whole = [episode.samples() for episode in Dataset.open(tmp_path / "dataset").episodes()]
    assert found.samples == sum(map(len, whole)) - 3
    efforts = np.concatenate([each.effort[np.isfinite(each.effort).all(axis=1), 3] for each in whole])
    signal = found.signals["effort_nm"][TALOS.joints[3]]
    assert (signal.min, signal.max) == (efforts.min(), efforts.max())
    json.dumps(asdict(found), allow_nan=False)


def test_statistics_of_a_dataset_without_episodes_have_no_signals(collection: Collection, tmp_path: Path) -> None:
    collection.collect(tmp_path / "dataset", lost=range(7))
    found = statistics(tmp_path / "dataset")
    assert (found.episodes, found.samples, found.signals) == (0, 0, {})
    assert found.columns["landing_x_m"].mean is None
