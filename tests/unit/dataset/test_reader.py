from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect.dataset.mcap_reader import opened
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError


def test_an_episode_comes_back_as_it_went_in(collection: Any, dataset: Path) -> None:
    opened_dataset = Dataset.open(dataset)
    for trial in (5, 0, 6):
        sent, stored = collection.episode(trial), opened_dataset.episode(trial)
        assert (stored.header, stored.chunk, stored.digest) == (sent.header, sent.chunk, sent.digest)
        assert np.array_equal(stored.samples().position, sent.samples().position)


def test_iteration_is_in_order_and_skips_what_was_lost(collection: Any, tmp_path: Path) -> None:
    dataset = Dataset.open(collection.collect(tmp_path / "dataset", [6, 3, 5, 0, 4, 1, 2], lost=[0, 4]))
    assert len(dataset) == 5
    assert [episode.header.trial for episode in dataset] == [1, 2, 3, 5, 6]
    assert dataset.plan == collection.plan
    assert dataset.config == collection.config


def test_a_trial_without_episode_says_why(collection: Any, tmp_path: Path) -> None:
    dataset = Dataset.open(collection.collect(tmp_path / "dataset", lost=[4]))
    with pytest.raises(DatasetError, match="trial 4 has no episode: lost: two simulations were lost"):
        dataset.episode(4)
    with pytest.raises(DatasetError, match="no trial 7"):
        dataset.episode(7)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("throws.parquet", r"throws\.parquet: is missing"),
        ("plan.parquet", r"plan\.parquet: is missing"),
        ("metadata.yaml", "is not finished"),
    ],
)
def test_a_missing_file_is_named(dataset: Path, name: str, message: str) -> None:
    (dataset / name).unlink()
    with pytest.raises(DatasetError, match=message):
        Dataset.open(dataset)


@pytest.mark.parametrize("name", ["throws.parquet", "plan.parquet", "metadata.yaml"])
def test_a_damaged_file_is_named(dataset: Path, name: str) -> None:
    (dataset / name).write_bytes(b"\x89 nothing of the kind")
    with pytest.raises(DatasetError, match=name):
        Dataset.open(dataset)


def test_a_missing_shard_is_named(dataset: Path) -> None:
    opened_dataset = Dataset.open(dataset)
    (dataset / "quick_00001.mcap").unlink()
    with pytest.raises(DatasetError, match=r"quick_00001\.mcap: cannot be read"):
        opened_dataset.episode(4)


@pytest.mark.parametrize("size", [0, 5, 100])
def test_a_file_that_is_no_mcap_is_refused(tmp_path: Path, size: int) -> None:
    (tmp_path / "x.mcap").write_bytes(bytes(size))
    with pytest.raises(DatasetError, match="not an MCAP file"), opened(tmp_path / "x.mcap"):
        pass


def test_a_cut_within_a_record_is_an_error(dataset: Path, tmp_path: Path) -> None:
    whole = (dataset / "quick_00002.mcap").read_bytes()
    with opened(dataset / "quick_00002.mcap") as contents:
        ends = {record.end for record in contents.records()}
    for size in set(range(9, len(whole) - 8, 997)) - ends:
        (tmp_path / "cut.mcap").write_bytes(whole[:size])
        with opened(tmp_path / "cut.mcap") as contents, pytest.raises(DatasetError, match=r"cut off|beyond the end"):
            list(contents.records())
