"""Lost trials of a growing plan run again: the dataset becomes the same as that of an undisturbed collection."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator.collection import TrialCollection
from throwcollect.coordinator.prepare import prepare
from throwcollect.coordinator.resume import resume
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.episode_message import Delivery
from throwcollect.errors import LossError
from throwcollect.replay.replayer import Replayer
from throwcollect.sweep.target_sampler import TargetSampler
from throwcollect.sweep.trials import Trial

LANDED = 64
"""All trials land, so the first round is enough unless one of its trials is lost."""
PARAMETERS = {"task.duration_s": {"min": 1.0, "max": 1.6}, "task.trajectory.gamma": {"min": 1.0, "max": 1.4}}
TARGET = {"distance_m": {"min": 0.5, "max": 2.0, "bins": 6}}


def configuration(*, per_shard: int, target: bool) -> Config:
    return Config.model_validate(
        {
            "name": "grown",
            # Rounds of 64, 64 and 8: the third is the first that depends on results.
            "trials": 136,
            "until": None if target else {"landed": LANDED},
            "sweep": {"parameters": PARAMETERS, "target": TARGET if target else None},
            "sim": {"engine": "ballistic", "physics_hz": 125},
            "record": {"rate_hz": 25, "trials_per_shard": per_shard},
            "run": {"retries": 0, "replay": 0},
        }
    )


@pytest.fixture(scope="module")
def simulate() -> Iterator[Callable[[Trial], Delivery]]:
    """Simulates a trial, each only once: collections that differ only in shards have the same trials."""
    replayer = Replayer(configuration(per_shard=64, target=False))
    deliveries: dict[tuple[int, str], Delivery] = {}

    def simulate(trial: Trial) -> Delivery:
        key = (trial.number, trial.digest)
        if key not in deliveries:
            deliveries[key] = replayer.delivery(trial)
        return deliveries[key]

    yield simulate
    replayer.close()


def collect(directory: Path, simulate: Callable[[Trial], Delivery], *, lose: Collection[int] = ()) -> str:
    """Collect the remaining trials of a dataset; `lose` lists trials whose simulation dies. Returns the messages."""
    said: list[str] = []
    with TrialCollection.open(directory, say=said.append) as collection:
        collection.warn = said.append
        collection.join("/sim_0", "sim_0")
        while not collection.finished:
            if leased := collection.lease("/sim_0"):
                if leased[0] in lose:
                    collection.take_back("/sim_0", "died")
                else:
                    assert collection.take_in("/sim_0", simulate(collection.writer.plan.trial(leased[0])))
            else:
                collection.grow_plan()
            if collection.backlog:
                collection.write_one()
        if lose:
            with pytest.raises(LossError):
                collection.finish(meanwhile=lambda: None, say=said.append)
        else:
            collection.finish(meanwhile=lambda: None, say=said.append)
    return "\n".join(said)


def go_on(config: Config, directory: Path, simulate: Callable[[Trial], Delivery], **options: Collection[int]) -> str:
    resume(config, directory, sweep_directory=directory)
    return collect(directory, simulate, **options)


def fingerprints(directory: Path) -> dict[str, str]:
    """SHA-256 of every file that must be the same for the same configuration."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(directory.iterdir())
        if path.is_file() and path.name not in ("README.md", "provenance.json")
    }


def die(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(("per_shard", "target"), [(40, False), (300, True)])
def test_lost_trials_that_are_run_again_give_the_undisturbed_dataset(
    per_shard: int, target: bool, tmp_path: Path, simulate: Callable[[Trial], Delivery], monkeypatch: pytest.MonkeyPatch
) -> None:
    config = configuration(per_shard=per_shard, target=target)
    expected, directory = tmp_path / "expected", tmp_path / "data"
    for each in (expected, directory):
        prepare(config, each, sweep_directory=tmp_path)
    collect(expected, simulate)
    collect(directory, simulate, lose={1, 3, 120})
    assert verify(directory) == []
    lost = fingerprints(directory)
    assert lost["plan.parquet"] != fingerprints(expected)["plan.parquet"]
    # If the same trials are lost again, no file changes.
    assert "removed" not in go_on(config, directory, simulate, lose={1, 3, 120})
    assert fingerprints(directory) == lost
    if target:
        with monkeypatch.context() as patch:
            patch.setattr(DatasetWriter, "_reopen", die)
            with pytest.raises(KeyboardInterrupt):
                go_on(config, directory, simulate, lose={120})
    # Trial 120 stays lost, although other trials of its shard are removed.
    go_on(config, directory, simulate, lose={120})
    assert verify(directory) == []
    go_on(config, directory, simulate)
    assert fingerprints(directory) == fingerprints(expected)
    # Damage loses episodes on whose results later rounds depend. These rounds stay, as the same results come again.
    with next(directory.glob("*_00000.mcap")).open("r+b") as shard:
        shard.seek(50_000)
        shard.write(bytes(100_000))
    assert "removed" not in go_on(config, directory, simulate)
    assert fingerprints(directory) == fingerprints(expected)


def test_rounds_that_another_library_version_drew_are_kept_on_resume(
    tmp_path: Path, simulate: Callable[[Trial], Delivery], monkeypatch: pytest.MonkeyPatch
) -> None:
    config = configuration(per_shard=40, target=True)
    directory = tmp_path / "data"
    prepare(config, directory, sweep_directory=tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(TargetSampler, "draw", lambda _self, otherwise, _tried, _ended: otherwise)
        collect(directory, simulate)
    before = fingerprints(directory)
    (directory / "metadata.yaml").unlink()
    assert "removed" not in go_on(config, directory, simulate)
    assert fingerprints(directory) == before


def test_a_missing_plan_is_made_again_beside_unfinished_files_of_later_shards(
    tmp_path: Path, simulate: Callable[[Trial], Delivery]
) -> None:
    config = configuration(per_shard=40, target=True)
    expected, directory = tmp_path / "expected", tmp_path / "data"
    for each in (expected, directory):
        prepare(config, each, sweep_directory=tmp_path)
    collect(expected, simulate)

    def die_in_the_last_shard(trial: Trial) -> Delivery:
        if trial.number == 130:
            raise KeyboardInterrupt
        return simulate(trial)

    with pytest.raises(KeyboardInterrupt):
        collect(directory, die_in_the_last_shard)
    assert list(directory.glob("*_00003.mcap.part"))
    (directory / "plan.parquet").unlink()
    (directory / "plan.rounds.part").unlink()
    go_on(config, directory, simulate)
    assert fingerprints(directory) == fingerprints(expected)
