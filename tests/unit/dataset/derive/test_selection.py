"""Filtering, sampling and merging datasets."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import flip
from tests.unit.dataset.mutations import fit_manifest

from throwcollect.collect.coordinator.resume import resume
from throwcollect.config.loader import load
from throwcollect.dataset.derive.derivation import filter_trials, merge, sample
from throwcollect.dataset.derive.statistics import statistics
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.publish.export.export import export


def sources(directory: Path) -> list[tuple[str, int]]:
    table = pq.read_table(directory / "sources.parquet")
    return list(zip(table["source_directory"].to_pylist(), table["source_trial"].to_pylist(), strict=True))


def test_a_filtered_dataset_has_the_trials_that_fulfil_the_condition(collected: Path, tmp_path: Path) -> None:
    before = Dataset.open(collected)
    found = filter_trials(collected, tmp_path / "some", where="trial % 2 == 1")
    after = Dataset.open(tmp_path / "some")
    assert verify(tmp_path / "some") == []
    assert (found.trials, found.without_episode) == (3, {})
    assert found.digest == info(tmp_path / "some").digest
    assert sources(tmp_path / "some") == [(str(collected), number) for number in (1, 3, 5)]
    odd = before.throws.filter(pa.array([False, True, False, True, False, True, False]))
    columns = [name for name in odd.column_names if name != "chunk_offset"]
    assert after.throws.select(columns) == odd.select(columns)
    for throw, number in zip(after, (1, 3, 5), strict=True):
        assert throw.trial == number
        assert np.array_equal(throw.joints.time_s, before[number].joints.time_s)
        assert after.episode(number).chunk == before.episode(number).chunk
    assert after.trajectories()["ball_position"].shape == after.recorded.trajectories()["ball_position"].shape


def test_a_filter_that_keeps_all_trials_copies_the_shards_byte_for_byte(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "all", where="True")
    names = {path.name for path in (tmp_path / "all").iterdir()} - {"sources.parquet", "trials.parquet"}
    assert names == {path.name for path in collected.iterdir()}
    for name in names - {"README.md", "provenance.json", "config.yaml", "plan.parquet", "datapackage.json"}:
        assert (tmp_path / "all" / name).read_bytes() == (collected / name).read_bytes(), name


def test_a_filter_leaves_out_and_counts_trials_without_an_episode(collection: Collection, tmp_path: Path) -> None:
    collection.refuse(2, "too fast")
    collection.collect(tmp_path / "source", [0, 1, 3, 4, 5, 6], lost=[4])
    found = filter_trials(tmp_path / "source", tmp_path / "some", where="trial < 6")
    assert found.without_episode == {"lost": 1, "refused": 1}
    assert [number for _, number in sources(tmp_path / "some")] == [0, 1, 3, 5]
    with pytest.raises(ConfigError, match=r"no trial of .* that has an episode fulfils \"outcome == 'lost'\""):
        filter_trials(tmp_path / "source", tmp_path / "none", where="outcome == 'lost'")
    assert not (tmp_path / "none").exists()


def test_a_random_sample_of_trials_depends_on_the_seed_and_stays_in_order(collected: Path, tmp_path: Path) -> None:
    chosen = {}
    for name, count, seed in (("a", 4, 1), ("c", 4, 2), ("d", 2, 1)):
        sample(collected, tmp_path / name, count=count, seed=seed)
        chosen[name] = [number for _, number in sources(tmp_path / name)]
        assert chosen[name] == sorted(set(chosen[name]))
        assert len(chosen[name]) == count
    assert chosen["a"] != chosen["c"]
    assert set(chosen["d"]) < set(chosen["a"])
    for count in (0, 8):
        with pytest.raises(ConfigError, match=f"should be from 1 to 7, the number of episodes of .*, got {count}"):
            sample(collected, tmp_path / "e", count=count)


@pytest.fixture
def other(make_collection: type[Collection], tmp_path: Path) -> Path:
    """A dataset with the trial numbers of `collected`, of another plan with other keys, in shards of another size."""
    settings = {
        "name": "other",
        "seed": 5,
        "trials": 4,
        "ball": {"mass_kg": 0.03},
        "record": {"zstd_level": 3, "trials_per_shard": 8},
        "sweep": {"sampler": "uniform", "parameters": {"task.trajectory.gamma": {"min": 1.0, "max": 1.2}}},
    }
    return make_collection(settings).collect(tmp_path / "other")


def test_merged_datasets_of_different_plans_follow_each_other_with_the_bytes_of_their_episodes(
    collected: Path, other: Path, tmp_path: Path
) -> None:
    found = merge([collected, other], tmp_path / "all")
    assert verify(tmp_path / "all") == []
    assert (found.trials, found.digest) == (11, info(tmp_path / "all").digest)
    assert sources(tmp_path / "all") == [
        *((str(collected), number) for number in range(7)),
        *((str(other), number) for number in range(4)),
    ]
    ours, theirs, merged = (Dataset.open(each) for each in (collected, other, tmp_path / "all"))
    assert merged.plan.keys == ("task.duration_s", "task.trajectory.gamma", "ball.mass_kg")
    assert [tuple(trial.values.values()) for trial in merged.plan.trials] == [
        *((trial.values["task.duration_s"], 1.2, 0.045) for trial in ours.plan.trials),
        *((1.0, trial.values["task.trajectory.gamma"], 0.03) for trial in theirs.plan.trials),
    ]
    assert (merged.config.name, merged.config.seed, merged.config.record) == (
        ours.config.name,
        ours.config.seed,
        ours.config.record,
    )
    assert merged.throws["digest"].to_pylist() == [
        *ours.throws["digest"].to_pylist(),
        *theirs.throws["digest"].to_pylist(),
    ]
    origins = [(source, throw) for source in (ours, theirs) for throw in source]
    for number, (throw, (dataset, source)) in enumerate(zip(merged, origins, strict=True)):
        assert throw.trial == number
        assert np.array_equal(throw.ball.position, source.ball.position)
        assert throw.events.release.time_s == source.events.release.time_s
        assert merged.episode(number).chunk == dataset.episode(source.trial).chunk
    one, two = ours.trajectories(), theirs.trajectories()
    both = merged.trajectories()
    assert np.array_equal(both["time_s"], np.concatenate([one["time_s"], two["time_s"]]))
    # A file holds episodes of one plan alone, so times increase in each.
    assert merged.shards == tuple(f"quick_{number:05d}.mcap" for number in range(5))
    card = (tmp_path / "all" / "README.md").read_text()
    assert f"- `{other}` (other): 4 trials; digest {info(other).digest}\n" in card


def test_derived_datasets_can_be_derived_from(collected: Path, other: Path, tmp_path: Path) -> None:
    merge([collected, other], tmp_path / "all")
    filter_trials(tmp_path / "all", tmp_path / "light", where="ball_mass_kg < 0.04 and trial != 8")
    assert verify(tmp_path / "light") == []
    light = Dataset.open(tmp_path / "light")
    assert [throw.trial for throw in light] == [7, 9, 10]
    assert [light.episode(throw.trial).header.trial for throw in light] == [0, 2, 3]
    merge([tmp_path / "light", collected], tmp_path / "again")
    assert verify(tmp_path / "again") == []
    assert [throw.trial for throw in Dataset.open(tmp_path / "again")] == [7, 9, 10, *range(11, 18)]
    statistics(tmp_path / "again")
    export(tmp_path / "again", tmp_path / "export", to="npz")


def test_merging_the_parts_of_a_dataset_gives_its_recordings_byte_for_byte(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "odd", where="trial % 2 == 1")
    filter_trials(collected, tmp_path / "even", where="trial % 2 == 0")
    merge([tmp_path / "odd", tmp_path / "even"], tmp_path / "both")
    filter_trials(collected, tmp_path / "all", where="True")
    for name in ("throws.parquet", "plan.parquet", "config.yaml", "metadata.yaml"):
        assert (tmp_path / "both" / name).read_bytes() == (tmp_path / "all" / name).read_bytes(), name
    for path in collected.glob("*.mcap"):
        assert (tmp_path / "both" / path.name).read_bytes() == path.read_bytes()


def test_merging_datasets_that_have_a_trial_in_common_is_refused(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "some", where="trial < 2")
    for second in (collected, tmp_path / "some"):
        with pytest.raises(ConfigError, match=r"trials are in more than one of the datasets"):
            merge([collected, second], tmp_path / "all")
    assert not (tmp_path / "all").exists()


def test_nothing_is_collected_into_a_derived_dataset(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "some", where="trial < 2")
    before = {path: path.read_bytes() for path in (tmp_path / "some").iterdir()}
    with pytest.raises(DatasetError, match="was derived from other datasets, so nothing is collected into it"):
        resume(load(tmp_path / "some" / "config.yaml"), tmp_path / "some", sweep_directory=tmp_path / "some")
    assert {path: path.read_bytes() for path in (tmp_path / "some").iterdir()} == before


@pytest.mark.parametrize("name", ["sources.parquet", "trials.parquet"])
def test_verify_finds_changes_of_a_merged_dataset(collected: Path, other: Path, tmp_path: Path, name: str) -> None:
    merge([collected, other], tmp_path / "all")
    path = tmp_path / "all" / name
    flip(path, path.stat().st_size // 2)
    assert name in {finding.file for finding in verify(tmp_path / "all")}


def test_verify_finds_an_exchanged_episode_of_a_merged_dataset(collected: Path, other: Path, tmp_path: Path) -> None:
    merge([collected, other], tmp_path / "all")
    shutil.copy(tmp_path / "all" / "quick_00000.mcap", tmp_path / "all" / "quick_00003.mcap")
    fit_manifest(tmp_path / "all")
    places = {(finding.file, finding.place) for finding in verify(tmp_path / "all")}
    assert {("quick_00003.mcap", f"trial {number}") for number in range(7, 10)} <= places


def test_datasets_with_different_physics_cannot_be_merged(
    collected: Path, make_collection: type[Collection], tmp_path: Path
) -> None:
    tool, topics = {"mass_kg": 0.2}, ["joint_states", "ball/odometry", "clock"]
    other = make_collection({"trials": 1, "tool": tool, "record": {"rate_hz": 125, "topics": topics}})
    other.collect(tmp_path / "other")
    with pytest.raises(ConfigError) as caught:
        merge([collected, tmp_path / "other", collected], tmp_path / "all")
    assert [str(problem) for problem in caught.value.problems] == [
        "tool.mass_kg: is 0.12 and 0.2 in the datasets; cannot vary from trial to trial",
        "record.rate_hz: is 250 and 125 in the datasets; cannot vary from trial to trial",
        "record.topics.2: is absent and clock in the datasets; not all have this key",
    ]
    assert not (tmp_path / "all").exists()


def test_filter_and_merge_never_overwrite_a_directory_or_file(collected: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(ConfigError, match="mine: exists"):
        filter_trials(collected, tmp_path / "mine", where="True")
    with pytest.raises(ConfigError, match="expected: a directory that is new or empty"):
        merge([collected], collected)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_filtering_an_episode_that_differs_from_its_digest_in_the_table_is_refused(
    dataset: Path, collection: Collection, tmp_path: Path
) -> None:
    def shorter(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        return samples[:-1], replace(header, samples=header.samples - 1, contacts=header.contacts[:1])

    for shard in collection.collect(tmp_path / "other", change=shorter).glob("*.mcap"):
        shutil.copy(shard, dataset / shard.name)
    with pytest.raises(DatasetError, match=r"trial 0: digest .*\n.* as in throws.parquet"):
        filter_trials(dataset, tmp_path / "some", where="trial == 0")
