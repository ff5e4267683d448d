"""Resuming a dataset with missing or damaged files makes it what it was; without simulating, it keeps what is whole."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from tests.unit.collect.coordinator.listener import Listener
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import find_stored, flip

from throwcollect.collect.coordinator.resume import finish_without_simulating, has_all_trials, resume
from throwcollect.dataset.creation import create
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.tasks.throw.throw_result import ThrowResult

TRIALS = 4
SHARD = "quick_00001.mcap"
ALL = {*range(TRIALS)}


class Trials:
    """Episodes and results of a collection, made once."""

    def __init__(self) -> None:
        self.collection = Collection({"trials": TRIALS, "record": {"trials_per_shard": 2}})
        self.plan = self.collection.plan
        self.episodes = [self.collection.episode(trial) for trial in range(TRIALS)]
        self.results: list[ThrowResult] = [self.collection.result(episode) for episode in self.episodes]

    def run(self, directory: Path) -> set[int]:
        """Collect the missing trials; returns the trials that were kept."""
        kept: set[int] = set()
        writer = DatasetWriter.open(directory)
        writer.recover(lambda trial, _: kept.add(trial) is None)
        for trial in sorted(ALL - kept):
            writer.append(self.episodes[trial], self.collection.columns.write(self.results[trial]))
        writer.finish()
        writer.close()
        return kept

    def go_on(self, directory: Path) -> tuple[set[int] | None, list[str]]:
        """Resume; returns the trials that were kept, or None if there was nothing to do, and the warnings."""
        told = Listener()
        plan = resume(self.plan.config, directory, sweep_directory=directory, reporter=told)
        return None if has_all_trials(directory, plan) else self.run(directory), told.warnings

    def finish(self, directory: Path) -> dict[int, str | None]:
        """Finish without simulating; returns the reasons of the trials that are lost."""
        finish_without_simulating(self.plan.config, directory, sweep_directory=directory)
        rows = pq.read_table(directory / "throws.parquet").to_pylist()
        return {row["trial"]: row["reason"] for row in rows if row["outcome"] == "lost"}


@pytest.fixture(scope="module")
def trials() -> Trials:
    return Trials()


@pytest.fixture(scope="module")
def sound(trials: Trials, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("sound") / "dataset"
    create(directory, trials.plan)
    trials.run(directory)
    return directory


@pytest.fixture
def dataset(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "dataset"))


def contents(directory: Path) -> dict[str, bytes]:
    others = ("README.md", "datapackage.json", "provenance.json")
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.is_file() and path.name not in others}


def delete(path: Path) -> None:
    path.unlink()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def flip_bit(path: Path) -> None:
    flip(path, path.stat().st_size * 2 // 3)


def flip_index(path: Path) -> None:
    """Flip a bit in the message index of an episode, which is no longer whole then."""
    flip(path, (run := find_stored(path, 3).run).offset + run.chunk_indexes[0].chunk_length + 100)


def rename_to_part(path: Path) -> None:
    path.rename(path.with_name(f"{path.name}.part"))


WAYS = (delete, empty, cut, flip_bit)
TABLES = ("throws.parquet", "plan.parquet", "datapackage.json", "metadata.yaml")
DAMAGE = [
    *((name, way, ALL) for name in TABLES for way in (delete, flip_bit)),
    (SHARD, delete, {0, 1}),
    (SHARD, cut, ALL),
    (SHARD, flip_bit, {0, 1, 2}),
    (SHARD, flip_index, {0, 1, 2}),
    (SHARD, rename_to_part, ALL),
    ("provenance.json", delete, ALL),
]
NAMES = [f"{name}: {way.__name__}" for name, way, _ in DAMAGE]


@pytest.mark.parametrize(("name", "damage", "whole"), DAMAGE, ids=NAMES)
def test_resume_restores_the_bytes_of_a_damaged_dataset_and_keeps_whole_episodes(
    trials: Trials, sound: Path, dataset: Path, name: str, damage: Callable[[Path], None], whole: set[int]
) -> None:
    damage(dataset / name)
    kept, said = trials.go_on(dataset)
    assert kept == whole
    # A dataset without metadata.yaml is not finished, and a changed manifest names the files that it is wrong about.
    if name not in ("metadata.yaml", "datapackage.json"):
        assert f"{dataset}: {name}: " in "".join(said)
    assert contents(dataset) == contents(sound)
    assert verify(dataset) == []


@pytest.mark.parametrize(("name", "damage", "whole"), DAMAGE[7:], ids=NAMES[7:])
def test_finishing_without_simulating_keeps_whole_episodes_and_gives_up_the_others(
    trials: Trials, sound: Path, dataset: Path, name: str, damage: Callable[[Path], None], whole: set[int]
) -> None:
    provenance = read_provenance(dataset)
    damage(dataset / name)
    assert trials.finish(dataset) == dict.fromkeys(ALL - whole, "no whole episode of it was left")
    assert verify(dataset) == []
    assert name == "provenance.json" or read_provenance(dataset) == provenance
    if whole == ALL:
        assert contents(dataset) == contents(sound)
    assert trials.go_on(dataset)[0] == (None if whole == ALL else whole)
    assert contents(dataset) == contents(sound)


def test_finishing_without_simulating_keeps_the_reasons_of_trials_that_were_lost(
    trials: Trials, tmp_path: Path
) -> None:
    directory = trials.collection.collect(tmp_path / "dataset", lost=[2])
    (directory / "quick_00000.mcap").unlink()
    none = "no whole episode of it was left"
    assert trials.finish(directory) == {0: none, 1: none, 2: "two simulations were lost"}


@pytest.mark.parametrize("finish", [False, True])
def test_resuming_a_finished_dataset_changes_no_file(trials: Trials, dataset: Path, finish: bool) -> None:
    before = {path: path.stat().st_mtime_ns for path in dataset.rglob("*")}
    if finish:
        assert trials.finish(dataset) == {}
    else:
        assert trials.go_on(dataset) == (None, [])
    assert {path: path.stat().st_mtime_ns for path in dataset.rglob("*")} == before


@pytest.mark.parametrize("damage", WAYS)
def test_a_damaged_configuration_is_an_error_or_is_restored(
    trials: Trials, sound: Path, dataset: Path, damage: Callable[[Path], None]
) -> None:
    """`trials.go_on` gives the configuration of the dataset, as `up CONFIG --resume` does."""
    damage(dataset / "config.yaml")
    assert trials.go_on(dataset)[0] == ALL
    assert contents(dataset) == contents(sound)


@pytest.mark.parametrize(("name", "lost"), [("plan.parquet", []), ("throws.parquet", []), ("quick_00001.mcap", [3])])
def test_finishing_without_simulating_ends_a_dataset_with_until_where_it_ended(
    tmp_path: Path, name: str, lost: list[int]
) -> None:
    collection, directory = Collection({"until": {"landed": 4}}), tmp_path / "dataset"
    create(directory, collection.plan)
    with closing(DatasetWriter.open(directory)) as writer:
        collection.fill(writer, range(4))
        writer.end_with(3)
        writer.finish()
    before = contents(directory)
    (directory / name).unlink()
    finish_without_simulating(collection.config, directory, sweep_directory=directory)
    rows = pq.read_table(directory / "throws.parquet").to_pylist()
    assert [row["outcome"] for row in rows] == ["lost" if number in lost else "landed" for number in range(4)]
    assert lost or contents(directory) == before
