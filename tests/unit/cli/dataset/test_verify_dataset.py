"""What `throwcollect dataset verify` prints."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.cli.dataset.info import verify
from throwcollect.errors import DatasetError
from throwcollect.extras import MissingExtraError
from throwcollect.replay.audit import Comparison


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return Collection({"trials": 3}).collect(tmp_path / "a dataset")


@pytest.fixture
def differing() -> set[int]:
    """The trials whose replay differs."""
    return set()


@pytest.fixture
def replays(monkeypatch: pytest.MonkeyPatch, differing: set[int]) -> list[int]:
    """The trials that are replayed."""
    trials: list[int] = []

    def replay(_: Path, wanted: Sequence[int]) -> Iterator[Comparison]:
        trials.extend(wanted)
        yield from (Comparison(trial, "aa", "bb", ("effort: otherwise",) * (trial in differing)) for trial in wanted)

    monkeypatch.setattr("throwcollect.replay.audit.replay_throws", replay)
    return trials


def test_verify_replays_the_same_sample_each_time_and_names_the_command_that_replays_all(
    source: Path, replays: list[int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.replay.audit.SAMPLE", 2)
    for _ in range(2):
        verify(source, replay=None, json=False)
    assert len(replays) == 4
    assert replays[:2] == replays[2:]
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first == f"{source}: nothing wrong"
    assert second == (
        f"replayed: 2 of 3 throws, the same bit for bit (all: throwcollect dataset verify '{source}' --replay 3)"
    )


def test_without_an_engine_verify_replays_nothing_and_names_the_missing_package(
    source: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.extras.is_installed", lambda package: package != "pybullet")
    verify(source, replay=None, json=False)
    _, second = capsys.readouterr().out.splitlines()
    assert second.startswith("replayed: 0 of 3 throws (this needs pybullet, which is not installed")
    with pytest.raises(MissingExtraError):
        verify(source, replay=3, json=False)


def test_a_throw_that_replays_differently_is_a_finding_of_verify(
    source: Path, replays: list[int], differing: set[int], capsys: pytest.CaptureFixture[str]
) -> None:
    differing.add(1)
    with pytest.raises(DatasetError, match="1 finding"):
        verify(source, replay=3, json=True)
    assert replays == [0, 1, 2]
    assert json.loads(capsys.readouterr().out) == [
        {"file": "quick_00000.mcap", "place": "trial 1", "problem": "comes out differently: effort: otherwise"}
    ]


def test_verify_reports_a_dataset_that_cannot_be_opened_for_a_replay(
    source: Path, replays: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    (source / "throws.parquet").unlink()
    with suppress(DatasetError):
        verify(source, replay=3, json=False)
    assert "throws.parquet: is missing" in capsys.readouterr().out
    assert replays == []
