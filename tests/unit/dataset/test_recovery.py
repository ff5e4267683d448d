"""However a collection is interrupted, the next one goes on and ends with the same files."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from throwcollect.dataset.creation import create
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.side_by_side import work_side_by_side
from throwcollect.tasks.throw.throw_result import ThrowResult

from .conftest import Collection
from .kills import KilledEverywhere
from .mutations import Mutation, any_mutation, mutate

TRIALS = 4
SHARDS = ("quick_00000.mcap", "quick_00001.mcap")

damages = st.lists(
    any_mutation,
    max_size=3,
)


def abandon(writer: DatasetWriter) -> None:
    """Close the files, as the system does for a killed process."""
    with suppress(OSError):
        writer.close()


def files_of(directory: Path) -> dict[str, bytes]:
    others = ("README.md", "datapackage.json", "provenance.json")
    return {p.name: p.read_bytes() for p in directory.iterdir() if p.is_file() and p.name not in others}


def whole(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def keep_in(there: dict[int, ThrowResult]) -> Callable[[int, ThrowResult], bool]:
    """Keep all trials, and note their results."""
    return lambda trial, result: there.__setitem__(trial, result) is None


class Trials:
    """Episodes and results of a collection, made once."""

    def __repr__(self) -> str:
        return "trials"

    def __init__(self, collection: Any) -> None:
        self.plan = collection.plan
        self.columns = collection.columns
        self.episodes = [collection.episode(trial) for trial in range(TRIALS)]
        self.results: list[ThrowResult] = [collection.result(episode) for episode in self.episodes]

    def append(self, writer: DatasetWriter, trial: int) -> None:
        writer.append(self.episodes[trial], self.columns.write(self.results[trial]))

    def go_on(self, directory: Path, order: list[int] | None = None) -> set[int]:
        """Resume, run the missing trials, and finish; returns the trials that were kept."""
        there: dict[int, ThrowResult] = {}
        writer = DatasetWriter.open(directory)
        try:
            count = writer.recover(keep_in(there))
            assert count == len(there)
            assert all(self.results[trial] == result for trial, result in there.items())
            for trial in order or range(TRIALS):
                if trial not in there:
                    self.append(writer, trial)
            writer.finish()
        finally:
            abandon(writer)
        return set(there)


@pytest.fixture(scope="module")
def trials() -> Trials:
    return Trials(Collection({"trials": TRIALS, "record": {"trials_per_shard": 2}}))


@pytest.fixture(scope="module")
def expected(trials: Trials, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    directory = tmp_path_factory.mktemp("expected") / "dataset"
    create(directory, trials.plan)
    assert trials.go_on(directory) == set()
    return files_of(directory)


def test_a_collection_killed_at_any_instant_resumes_to_the_same_files(
    trials: Trials, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The configuration is whole in every copy. Reading it each time would take a third of the time of this test.
    monkeypatch.setattr("throwcollect.dataset.writer.read_config", lambda _: trials.plan.config)
    directory, copies = tmp_path / "begun", tmp_path / "copies"
    create(directory, trials.plan)
    begun = DatasetWriter.open(directory)
    with KilledEverywhere(directory, copies) as killed:
        begun.recover()
        for trial in [1, 2, 0, 3]:
            trials.append(begun, trial)
            killed.appended.add(trial)
        begun.finish()
        killed.copy()
    abandon(begun)
    assert len(killed.left) > 40
    tried = 0
    for call, (left, appended) in enumerate(killed.left):
        # A call that only waits for the disk leaves the same files as the next one.
        if left != killed.left[-1][0] and whole(left) == whole(killed.left[call + 1][0]):
            continue
        kept = trials.go_on(left)
        assert files_of(left) == expected, f"killed at call {call}"
        assert kept >= appended, f"killed at call {call}: episodes were lost"
        tried += 1
    assert tried > 40


def test_recovery_by_several_processes_keeps_the_same_episodes(
    trials: Trials, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "dataset"
    create(directory, trials.plan)
    begun = DatasetWriter.open(directory)
    for trial in [1, 0, 3]:
        trials.append(begun, trial)
    abandon(begun)
    monkeypatch.setattr("throwcollect.dataset.recovery._MANY_EPISODES", 1)
    there: dict[int, ThrowResult] = {}
    asked = []

    def ask(pieces: Any, *others: Any, processes: int, **named: Any) -> Any:
        asked.append(processes)
        return work_side_by_side(pieces, *others, processes=processes, **named)

    monkeypatch.setattr("throwcollect.dataset.recovery.work_side_by_side", ask)
    writer = DatasetWriter.open(directory)
    assert writer.recover(keep_in(there), processes=2) == 3
    abandon(writer)
    assert asked == [2]
    assert there == {trial: trials.results[trial] for trial in [0, 1, 3]}
    assert trials.go_on(directory) == {0, 1, 3}
    assert files_of(directory) == expected


@settings(
    max_examples=8,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    damage=st.dictionaries(st.sampled_from(SHARDS), damages, min_size=1),
    unfinished=st.dictionaries(st.sampled_from(SHARDS), st.booleans()),
)
def test_resuming_after_any_damage_to_recordings_gives_the_same_files(
    damage: dict[str, list[Mutation]],
    unfinished: dict[str, bool],
    trials: Trials,
    expected: dict[str, bytes],
    tmp_path: Path,
) -> None:
    """Finished and unfinished files are damaged in any way: episodes that are kept equal those collected again."""
    directory = tmp_path / "dataset"
    shutil.rmtree(directory, ignore_errors=True)
    create(directory, trials.plan)
    for name in SHARDS:
        damaged = mutate(expected[name], damage.get(name, []))
        if unfinished.get(name) is not None:
            (directory / f"{name}.part").write_bytes(damaged)
        if unfinished.get(name) is not True:
            (directory / name).write_bytes(damaged)
    trials.go_on(directory)
    assert files_of(directory) == expected


def test_recovery_removes_episodes_of_another_plan(trials: Trials, tmp_path: Path) -> None:
    other = Trials(Collection({"trials": TRIALS, "record": {"trials_per_shard": 2}, "sim": {"max_trial_s": 30.0}}))
    create(tmp_path / "other", other.plan)
    other.go_on(tmp_path / "other")
    create(tmp_path / "dataset", trials.plan)
    shutil.copy(tmp_path / "other" / "quick_00000.mcap", tmp_path / "dataset")
    writer = DatasetWriter.open(tmp_path / "dataset")
    assert writer.recover() == 0
    writer.close()
    assert not list((tmp_path / "dataset").glob("*.mcap*"))


def test_a_lost_trial_is_run_again_on_resume(trials: Trials, expected: dict[str, bytes], tmp_path: Path) -> None:
    directory = tmp_path / "dataset"
    create(directory, trials.plan)
    writer = DatasetWriter.open(directory)
    writer.append_lost(2, "gone")
    for trial in (0, 1, 3):
        trials.append(writer, trial)
    writer.finish()
    writer.close()
    assert trials.go_on(directory) == {0, 1, 3}
    assert files_of(directory) == expected
