"""The check of a dataset in one call: its arguments, and the throws that it simulates again."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.replay import verify_dataset


def test_throws_that_come_out_differently_are_found(make_collection: type[Collection], tmp_path: Path) -> None:
    # No simulation has made these throws.
    directory = make_collection({"sim": {"engine": "ballistic"}}).collect(tmp_path / "data", lost=[2])
    before = verify_dataset(directory, replay=0)
    after = verify_dataset(directory, replay=7)
    assert after[: len(before)] == before
    assert [(each.file, each.place) for each in after[len(before) :]] == [
        (f"quick_0000{trial // 3}.mcap", f"trial {trial}") for trial in (0, 1, 3, 4, 5, 6)
    ]
    assert all(each.problem.startswith("comes out differently: ") for each in after[len(before) :])


def test_a_few_throws_are_simulated_again_where_libraries_are_those_of_the_collection(
    make_collection: type[Collection], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # No simulation has made these throws.
    directory = make_collection({"sim": {"engine": "ballistic"}}).collect(tmp_path / "data")
    monkeypatch.setattr("throwcollect.replay.SAMPLE", 2)
    assert sum("comes out differently" in each.problem for each in verify_dataset(directory)) == 2
    monkeypatch.setattr("throwcollect.replay.find_versions", lambda: {"numpy": "1.0"})
    assert verify_dataset(directory) == verify_dataset(directory, replay=0)
