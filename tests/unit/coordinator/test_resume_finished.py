"""Resuming a finished dataset with missing or damaged files makes it what it was."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.unit.coordinator.listener import Listener
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import flip

from throwcollect.coordinator.resume import has_all_trials, resume
from throwcollect.dataset.creation import create
from throwcollect.dataset.manifest import entry_of_file, list_promised_names, manifest_text
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import DatasetError
from throwcollect.tasks.throw.throw_result import ThrowResult

TRIALS = 4
SHARD = "quick_00001.mcap"


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
        for trial in sorted({*range(TRIALS)} - kept):
            writer.append(self.episodes[trial], self.results[trial])
        writer.finish(wall_s=1.0)
        writer.close()
        return kept

    def go_on(self, directory: Path, *, check: bool = False) -> tuple[set[int] | None, list[str]]:
        """Resume; returns the trials that were kept, or None if there was nothing to do, and the warnings."""
        told = Listener()
        plan = resume(self.plan.config, directory, sweep_directory=directory, check=check, onlooker=told)
        return None if has_all_trials(directory, plan) else self.run(directory), told.warnings


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
def promised(sound: Path, tmp_path: Path) -> Path:
    """A dataset with a manifest."""
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    entries = [entry_of_file(directory / name) for name in list_promised_names(directory)]
    (directory / "datapackage.json").write_text(manifest_text("quick", entries))
    return directory


@pytest.fixture(params=["manifest", "no manifest"])
def dataset(request: pytest.FixtureRequest, promised: Path) -> Path:
    """A dataset with or, as earlier versions wrote it, without a manifest."""
    if request.param == "no manifest":
        (promised / "datapackage.json").unlink()
    return promised


def contents(directory: Path) -> dict[str, bytes]:
    others = ("README.md", "provenance.json", "datapackage.json")
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.is_file() and path.name not in others}


def delete(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def flip_bit(path: Path) -> None:
    flip(path, path.stat().st_size * 2 // 3)


def test_resuming_a_finished_dataset_changes_no_file(trials: Trials, dataset: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in dataset.rglob("*")}
    assert trials.go_on(dataset) == (None, [])
    assert trials.go_on(dataset, check=True) == (None, [])
    assert {path: path.stat().st_mtime_ns for path in dataset.rglob("*")} == before


def test_resume_keeps_a_configuration_of_an_earlier_version(trials: Trials, promised: Path) -> None:
    """The configuration lacks keys that were added later, and the manifest has its size and hash."""
    path = promised / "config.yaml"
    earlier = path.read_text()[: path.read_text().index("cluster:")]
    path.write_text(earlier)
    entries = [entry_of_file(promised / name) for name in list_promised_names(promised)]
    (promised / "datapackage.json").write_text(manifest_text("quick", entries))
    assert trials.go_on(promised) == (None, [])
    assert path.read_text() == earlier


@pytest.mark.parametrize(
    ("damage", "check", "kept"),
    [(delete, False, {0, 1}), (cut, False, {0, 1, 2, 3}), (flip_bit, True, {0, 1, 2})],
)
def test_resume_restores_the_bytes_of_a_damaged_recording(
    trials: Trials, sound: Path, dataset: Path, damage: Callable[[Path], None], check: bool, kept: set[int]
) -> None:
    damage(dataset / SHARD)
    found, said = trials.go_on(dataset, check=check)
    assert found == kept
    assert said
    assert all(line.startswith(f"{dataset}: {SHARD}: ") for line in said)
    assert contents(dataset) == contents(sound)


@pytest.mark.parametrize("name", ["throws.parquet", "plan.parquet"])
def test_resume_with_check_writes_damaged_tables_again(trials: Trials, sound: Path, promised: Path, name: str) -> None:
    flip_bit(promised / name)
    assert trials.go_on(promised, check=True)[0] == {*range(TRIALS)}
    assert contents(promised) == contents(sound)


def test_resume_restores_a_dataset_whose_manifest_is_damaged(trials: Trials, sound: Path, promised: Path) -> None:
    (promised / "datapackage.json").write_text("{}")
    assert trials.go_on(promised)[0] == {*range(TRIALS)}
    assert contents(promised) == contents(sound)


def test_resume_without_a_file_that_cannot_be_made_again_is_an_error(trials: Trials, promised: Path) -> None:
    dataset = promised
    entries = [entry_of_file(dataset / name) for name in list_promised_names(dataset)]
    (dataset / "sources.parquet").write_bytes(b"from there")
    entries.append(entry_of_file(dataset / "sources.parquet"))
    (dataset / "datapackage.json").write_text(manifest_text("quick", entries))
    (dataset / "sources.parquet").unlink()
    before = contents(dataset)
    with pytest.raises(DatasetError, match=r"sources\.parquet: is missing or damaged, and nothing else says"):
        trials.go_on(dataset)
    assert contents(dataset) == before


def test_resume_refuses_a_dataset_whose_configuration_was_changed(trials: Trials, dataset: Path) -> None:
    text = (dataset / "config.yaml").read_text()
    (dataset / "config.yaml").write_text(text.replace("seed: 0", "seed: 1"))
    before = contents(dataset)
    other = trials.plan.config.model_copy(update={"seed": 1})
    with pytest.raises(DatasetError, match=r"one of the two was changed, and nothing says which"):
        resume(other, dataset, sweep_directory=dataset)
    assert contents(dataset) == before
