import shutil
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.mutations import fit_manifest
from tests.unit.sweep.own_plan import make_plan

from throwcollect.config.loader import load
from throwcollect.dataset.inspect import digest
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.derive.selection import filter_trials, merge, sample
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError


def sources(directory: Path) -> list[tuple[str, int]]:
    table = pq.read_table(directory / "sources.parquet")
    return list(zip(table["source_directory"].to_pylist(), table["source_trial"].to_pylist(), strict=True))


def test_a_filtered_dataset_has_the_trials_that_fulfil_the_condition(collected: Path, tmp_path: Path) -> None:
    before = Dataset.open(collected)
    found = filter_trials(collected, tmp_path / "some", where="trial % 2 == 1")
    after = Dataset.open(tmp_path / "some")
    assert verify(tmp_path / "some") == []
    assert (found.trials, found.offered, found.without_episode) == (3, 7, {})
    assert found.digest == digest(tmp_path / "some")
    assert sources(tmp_path / "some") == [(str(collected), number) for number in (1, 3, 5)]
    odd = before.throws.filter(pa.array([False, True, False, True, False, True, False]))
    measured = [name for name in odd.column_names if name not in ("trial", "shard", "chunk_offset", "digest")]
    assert after.throws.select(measured) == odd.select(measured)


def test_the_plan_of_a_filtered_dataset_can_be_drawn_from_its_configuration(collected: Path, tmp_path: Path) -> None:
    filter_trials(collected, tmp_path / "some", where="trial > 3")
    config = load(tmp_path / "some" / "config.yaml")
    assert make_plan(config, directory=tmp_path / "some") == Dataset.open(tmp_path / "some").plan


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


def test_a_merged_dataset_sweeps_the_keys_that_any_source_sweeps_or_that_differ(
    collected: Path, make_collection: type[Collection], tmp_path: Path
) -> None:
    other = make_collection(
        {
            "name": "other",
            "seed": 5,
            "trials": 2,
            "ball": {"mass_kg": 0.03},
            "record": {"zstd_level": 3, "trials_per_shard": 8},
            "sweep": {"sampler": "uniform", "parameters": {"task.trajectory.gamma": {"min": 1.0, "max": 1.2}}},
        }
    )
    other.collect(tmp_path / "other")
    found = merge([collected, tmp_path / "other", collected], tmp_path / "all")
    assert verify(tmp_path / "all") == []
    assert (found.trials, found.offered) == (16, 16)
    merged = Dataset.open(tmp_path / "all")
    assert merged.plan.keys == ("task.duration_s", "task.trajectory.gamma", "ball.mass_kg")
    values = [tuple(trial.values.values()) for trial in merged.plan.trials]
    ours = [(trial.values["task.duration_s"], 1.2, 0.045) for trial in Dataset.open(collected).plan.trials]
    theirs = [(1.0, trial.values["task.trajectory.gamma"], 0.03) for trial in other.plan.trials]
    assert values == [*ours, *theirs, *ours]
    first = Dataset.open(collected).config
    assert (merged.config.name, merged.config.seed, merged.config.record) == (first.name, first.seed, first.record)
    card = (tmp_path / "all" / "README.md").read_text()
    assert f"| other | {tmp_path / 'other'} | 2 | 2 | {digest(tmp_path / 'other')} |" in card
    # A derived dataset can be the source of another one.
    filter_trials(tmp_path / "all", tmp_path / "light", where="ball_mass_kg < 0.04")
    assert verify(tmp_path / "light") == []
    assert [number for _, number in sources(tmp_path / "light")] == [7, 8]


def test_merging_takes_an_absent_offset_of_a_joint_as_zero(
    collected: Path, make_collection: type[Collection], tmp_path: Path
) -> None:
    elbow = "arm_right_4_joint"
    make_collection({"trials": 2, "robot": {"joint_offsets": {elbow: 0.05}}}).collect(tmp_path / "other")
    for name, order in (("behind", [collected, tmp_path / "other"]), ("before", [tmp_path / "other", collected])):
        merge(order, tmp_path / name)
        assert verify(tmp_path / name) == []
        assert load(tmp_path / name / "config.yaml").robot.joint_offsets.keys() == {elbow}
    offsets = [trial.values[f"robot.joint_offsets.{elbow}"] for trial in Dataset.open(tmp_path / "behind").plan.trials]
    assert offsets == [0.0] * 7 + [0.05] * 2


def test_datasets_with_different_physics_cannot_be_merged(
    collected: Path, make_collection: type[Collection], tmp_path: Path
) -> None:
    tool, topics = {"mass_kg": 0.2}, ["joint_states", "ball/odometry", "clock"]
    other = make_collection({"trials": 1, "tool": tool, "record": {"rate_hz": 125, "topics": topics}})
    other.collect(tmp_path / "other")
    with pytest.raises(ConfigError) as caught:
        merge([collected, tmp_path / "other", collected], tmp_path / "all")
    where = f"in {collected} and {collected}"
    assert [str(problem) for problem in caught.value.problems] == [
        f"tool.mass_kg: 0.12 {where}, 0.2 in {tmp_path / 'other'}; cannot vary from trial to trial",
        f"record.rate_hz: 250 {where}, 125 in {tmp_path / 'other'}; cannot vary from trial to trial",
        f"record.topics.2: absent {where}, clock in {tmp_path / 'other'}; not all have this key",
    ]
    assert caught.value.hint is None
    assert not (tmp_path / "all").exists()


def test_merging_datasets_of_two_engines_fails_with_a_hint_how_to_compare_them(
    collected: Path, make_collection: type[Collection], tmp_path: Path
) -> None:
    make_collection({"trials": 1, "sim": {"engine": "mujoco"}}).collect(tmp_path / "other")
    with pytest.raises(ConfigError, match=r"^sim\.engine: ") as caught:
        merge([collected, tmp_path / "other"], tmp_path / "all")
    compare = f"throwcollect dataset replay {collected} --all --engine mujoco"
    assert caught.value.hint == f"{compare} tells by how much throws of the two engines differ"


def test_filter_and_merge_never_overwrite_a_directory_or_file(collected: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(ConfigError, match="mine: exists"):
        filter_trials(collected, tmp_path / "mine", where="True")
    with pytest.raises(ConfigError, match="expected: a directory that is new or empty"):
        merge([collected], collected)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_filtering_a_damaged_episode_is_refused(dataset: Path, tmp_path: Path) -> None:
    shard = sorted(dataset.glob("*.mcap"))[1]
    contents = bytearray(shard.read_bytes())
    contents[len(contents) // 2] ^= 1
    shard.write_bytes(contents)
    with pytest.raises(DatasetError, match=r"dataset: trial [345]: .*\n.*throwcollect dataset verify"):
        filter_trials(dataset, tmp_path / "some", where="True")
    assert {path.name for path in tmp_path.iterdir()} == {"dataset"}


def test_filtering_an_episode_that_differs_from_its_digest_in_the_table_is_refused(
    dataset: Path, collection: Collection, tmp_path: Path
) -> None:
    def shorter(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        return samples[:-1], replace(header, samples=header.samples - 1, contacts=header.contacts[:1])

    for shard in collection.collect(tmp_path / "other", change=shorter).glob("*.mcap"):
        shutil.copy(shard, dataset / shard.name)
    with pytest.raises(DatasetError, match=r"trial 0: digest .*\n.* as throws.parquet says"):
        filter_trials(dataset, tmp_path / "some", where="trial == 0")


def test_verify_reports_a_list_of_trials_that_differs_from_the_plan_or_is_missing(
    collected: Path, tmp_path: Path
) -> None:
    filter_trials(collected, tmp_path / "some", where="trial > 3")
    path = tmp_path / "some" / "trials.parquet"
    table = pq.read_table(path)
    pq.write_table(table.take([1, 0, *range(2, len(table))]), path)
    fit_manifest(tmp_path / "some")
    assert list(map(str, verify(tmp_path / "some"))) == [
        "trials.parquet: begins with other points than those of plan.parquet"
    ]
    path.unlink()
    fit_manifest(tmp_path / "some")
    assert list(map(str, verify(tmp_path / "some"))) == ["trials.parquet: is missing"]


def test_merge_refuses_a_single_path_and_an_empty_list(collected: Path, tmp_path: Path) -> None:
    for one, kind in ((str(collected), "a text"), (collected, "no list")):
        with pytest.raises(ConfigError, match=f"^directories: .* is {kind}\n  expected: a list of directories"):
            merge(one, tmp_path / "new")
    with pytest.raises(ConfigError, match=r"^directories: got none\n  expected: at least one dataset"):
        merge([], tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda *paths: filter_trials(*paths, where=lambda row: row),
            "where: got <function .*\n  expected: a text, such as: ",
        ),
        (lambda *paths: sample(*paths, count="2"), "count: should be from 1 to 7, .*, got '2'"),
        (lambda *paths: sample(*paths, count=2, seed=-1), "seed: got -1\n  expected: 0 or more"),
    ],
)
def test_an_argument_of_the_wrong_type_or_range_is_named_in_the_error(
    collected: Path, tmp_path: Path, ask, message: str
) -> None:
    with pytest.raises(ConfigError, match=f"^{message}"):
        ask(collected, tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
