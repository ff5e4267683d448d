from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.cli.dataset.verify_command import verify_dataset
from throwcollect.errors import DatasetError
from throwcollect.replay.comparison import Comparison


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return Collection({"trials": 3}).collect(tmp_path / "a dataset")


@pytest.fixture
def replays(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The trials that are replayed; the replay of trial 1 differs."""
    trials: list[int] = []

    def replay(_: Path, wanted: Sequence[int]) -> Iterator[Comparison]:
        trials.extend(wanted)
        yield from (Comparison(trial, "aa", "bb", ("effort: otherwise",) * (trial == 1)) for trial in wanted)

    monkeypatch.setattr("throwcollect.replay.verification.replay_throws", replay)
    return trials


def test_verify_of_a_sound_dataset_names_the_command_that_replays_it(
    source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verify_dataset(source, replay=None, json=False)
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"{source}: nothing wrong"
    assert f"throwcollect dataset verify '{source}' --replay 100" in second


def test_without_an_engine_verify_names_the_missing_package_and_no_replay_command(
    source: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.extras.is_installed", lambda package: package != "pybullet")
    verify_dataset(source, replay=None, json=False)
    _, second = capsys.readouterr().out.splitlines()
    assert "whether the simulation gives the same throws again (this needs pybullet, which is not installed" in second
    assert "--replay" not in second


def test_a_throw_that_replays_differently_is_a_finding_of_verify(
    source: Path, replays: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(DatasetError, match="1 finding"):
        verify_dataset(source, replay=100, json=True)
    assert replays == [0, 1, 2]
    assert json.loads(capsys.readouterr().out) == [
        {"file": "quick_00000.mcap", "place": "trial 1", "problem": "comes out differently: effort: otherwise"}
    ]


def test_verify_replays_the_same_throws_each_time(source: Path, replays: list[int]) -> None:
    for _ in range(2):
        with suppress(DatasetError):
            verify_dataset(source, replay=2, json=False)
    assert len(replays) == 4
    assert replays[:2] == replays[2:]


def test_verify_reports_a_dataset_that_cannot_be_opened_for_a_replay(
    source: Path, replays: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    (source / "throws.parquet").unlink()
    with pytest.raises(DatasetError, match="findings"):
        verify_dataset(source, replay=2, json=False)
    assert "cannot be replayed: " in capsys.readouterr().out
    assert replays == []
