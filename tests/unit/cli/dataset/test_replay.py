"""`throwcollect dataset replay`: which throws it simulates again, and what it prints."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pytest

from throwcollect.cli.dataset.info import replay
from throwcollect.dataset import reader
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.replay import audit
from throwcollect.replay.audit import Comparison

DIFFERENT = Comparison(5, "aa", "bb", ("samples: 300 stored, 301 now", "effort: from 0.100 s on, by up to 1e-12"))


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The trials that are replayed; the replay of trial 5 differs, trial 3 has no episode."""
    trials: list[int] = []
    shards = ["a.mcap" if trial != 3 else None for trial in range(20)]
    throws = pa.table({"trial": range(20), "shard": shards})
    dataset = SimpleNamespace(
        directory=Path("data"),
        config=SimpleNamespace(seed=1),
        throws=throws,
        recorded=SimpleNamespace(throws=throws.filter(throws["shard"].is_valid())),
        episode=lambda _: None,
    )

    def replay(_: Path, wanted: Sequence[int]) -> Iterator[Comparison]:
        trials.extend(wanted)
        yield from (DIFFERENT if trial == 5 else Comparison(trial, "aa", "aa", ()) for trial in wanted)

    monkeypatch.setattr(reader, "Dataset", SimpleNamespace(open=lambda _: dataset))
    monkeypatch.setattr(audit, "replay_throws", replay)
    return trials


def test_replay_counts_the_throws_that_are_the_same_again(
    chosen: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    replay(Path("data"), trials=[4, 7, 4], everything=False, sample=None, json=False)
    assert chosen == [4, 7]
    assert capsys.readouterr().out == "data: 2 throws replayed, the same bit for bit\n"


def test_a_throw_that_replays_differently_is_an_error_and_its_differences_are_printed(
    chosen: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(DatasetError, match="data: 1 of 2 throws came out differently"):
        replay(Path("data"), trials=[4, 5], everything=False, sample=None, json=False)
    assert capsys.readouterr().out == f"trial 5: {'; '.join(DIFFERENT.differences)}\n"


@pytest.mark.usefixtures("chosen")
def test_replaying_a_trial_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match="data: no trial 20\n  expected: trials from 0 to 19"):
        replay(Path("data"), trials=[20], everything=False, sample=None, json=False)


def test_replay_with_json_prints_every_comparison(chosen: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DatasetError, match="1 of 19 throws"):
        replay(Path("data"), trials=[], everything=True, sample=None, json=True)
    found = json.loads(capsys.readouterr().out)
    assert [each["trial"] for each in found] == chosen == [trial for trial in range(20) if trial != 3]
    assert found[4]["differences"] == list(DIFFERENT.differences)


def test_replay_draws_the_same_sample_each_time(chosen: list[int]) -> None:
    for _ in range(2):
        replay(Path("data"), trials=[], everything=True, sample=4, json=True)
    assert len(set(chosen)) == 4
    assert chosen[:4] == chosen[4:] == sorted(chosen[:4])


@pytest.mark.parametrize(
    ("trials", "everything", "sample", "message"),
    [
        ([], False, None, "which throws"),
        ([1], True, None, "which throws"),
        ([1], False, 3, "--sample: should be given with --all"),
    ],
)
def test_replay_refuses_options_that_leave_unclear_which_throws_are_meant(
    trials: list[int], everything: bool, sample: int | None, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        replay(Path("data"), trials=trials, everything=everything, sample=sample, json=False)
