"""Repair makes a sound dataset of a damaged one, and lists the lost trials."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import create_and_open
from tests.unit.dataset.damage import flip
from tests.unit.sweep.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.dataset import lock
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.repair import DifferingEpisode, LostTrial, _find_again, repair
from throwcollect.dataset.scan import scan_whole
from throwcollect.dataset.verify import verify
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.sweep.plan import Plan

SHARD = "quick_00001.mcap"
MAY_DIFFER = {"README.md", "provenance.json"}
NO_PLAN = "there is no such file to draw from"


def never(config: Config) -> Plan:
    raise ConfigError(NO_PLAN)


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "output"


def chunk_of(directory: Path, trial: int) -> int:
    offset = pq.read_table(directory / "throws.parquet")["chunk_offset"].to_pylist()[trial]
    assert isinstance(offset, int)
    return offset


def digest_of(directory: Path, trial: int) -> str:
    digest = pq.read_table(directory / "throws.parquet")["digest"].to_pylist()[trial]
    assert isinstance(digest, str)
    return digest


def same_files(one: Path, other: Path) -> bool:
    names = {path.name for path in one.iterdir()} - MAY_DIFFER
    return names == {path.name for path in other.iterdir()} - MAY_DIFFER and all(
        (one / name).read_bytes() == (other / name).read_bytes() for name in names
    )


def cut_summary(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data[:-300])


def damage_index(directory: Path) -> None:
    with open_mcap(directory / SHARD) as contents:
        index = contents.episode(contents.record(chunk_of(directory, 4))).chunks[0].indexes[4]
    flip(directory / SHARD, index.offset + 100)


def damage_latched_topics(directory: Path) -> None:
    flip(directory / SHARD, 6000)


def swap_shards(directory: Path) -> None:
    one, other = (directory / "quick_00000.mcap").read_bytes(), (directory / SHARD).read_bytes()
    (directory / "quick_00000.mcap").write_bytes(other)
    (directory / SHARD).write_bytes(one)


def delete_tables(directory: Path) -> None:
    (directory / "throws.parquet").unlink()
    (directory / "metadata.yaml").unlink()


def rename_to_part(directory: Path) -> None:
    (directory / SHARD).rename(directory / f"{SHARD}.part")


@pytest.mark.parametrize(
    "damage", [cut_summary, damage_index, damage_latched_topics, swap_shards, delete_tables, rename_to_part]
)
def test_repair_restores_the_original_files_if_no_episode_is_damaged(
    collected: Path, dataset: Path, output: Path, damage: Callable[[Path], None]
) -> None:
    damage(dataset)
    repaired = repair(dataset, output, remake=never)
    assert (repaired.trials, repaired.episodes, repaired.lost) == (7, 7, ())
    assert same_files(output, collected)


def test_repair_loses_only_the_damaged_episode(collection: Any, dataset: Path, output: Path, tmp_path: Path) -> None:
    flip(dataset / SHARD, chunk_of(dataset, 4) + 3000)
    before = {path.name: path.read_bytes() for path in dataset.iterdir()}
    repaired = repair(dataset, output, remake=never)
    assert repaired.lost == (LostTrial(4, "no whole episode of it was left"),)
    assert repaired.episodes == 6
    assert verify(output) == []
    assert {path.name: path.read_bytes() for path in dataset.iterdir()} == before
    writer = create_and_open(tmp_path / "same", collection.plan)
    collection.fill(writer, [0, 1, 2, 3, 5, 6])
    writer.append_lost(4, "no whole episode of it was left")
    writer.finish(wall_s=1.0)
    assert same_files(output, tmp_path / "same")


def test_repair_loses_the_trials_of_a_missing_recording(dataset: Path, output: Path) -> None:
    (dataset / SHARD).unlink()
    assert [lost.trial for lost in repair(dataset, output, remake=never).lost] == [3, 4, 5]
    assert verify(output) == []


def test_repair_keeps_trials_that_were_lost_before_and_does_not_count_them(
    collection: Any, tmp_path: Path, output: Path
) -> None:
    collection.refuse(6, "too fast")
    dataset = collection.collect(tmp_path / "dataset", range(6), lost=[2])
    assert repair(dataset, output, remake=never).lost == ()
    assert same_files(output, dataset)


def test_repair_finishes_an_unfinished_dataset(collection: Any, tmp_path: Path, output: Path) -> None:
    directory = tmp_path / "begun"
    writer = create_and_open(directory, collection.plan)
    collection.fill(writer, [5, 0, 2, 1, 3])
    writer.close()
    repaired = repair(directory, output, remake=never)
    assert [lost.trial for lost in repaired.lost] == [4, 6]
    assert repaired.episodes == 5
    assert verify(output) == []


def test_repair_refuses_a_dataset_that_is_being_collected(
    dataset: Path, output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "PATIENCE_S", 0.0)
    with (
        lock.hold_lock(dataset, alone=False),
        pytest.raises(DatasetError, match="another process collects into it, or changes it"),
    ):
        repair(dataset, output, remake=never)
    assert not output.exists()


def test_repair_takes_the_first_of_several_episodes_of_a_trial_and_says_so(dataset: Path, output: Path) -> None:
    (dataset / "quick_00003.mcap").write_bytes((dataset / SHARD).read_bytes())
    repaired = repair(dataset, output, remake=never)
    assert repaired.lost == ()
    assert len(repaired.remarks) == 3
    assert all(
        f"the same episode of trial {trial} was taken from {SHARD} already" in remark
        for trial, remark in zip((3, 4, 5), repaired.remarks, strict=True)
    )


def test_repair_drops_an_episode_that_contradicts_physics(collection: Any, tmp_path: Path, output: Path) -> None:
    def early(samples: Any, header: Any) -> Any:
        shifted = samples.ball_position + (header.trial == 2) * 1e-3 * (samples.stamps_ns % 7 == 0)[:, None]
        return type(samples)(**{**vars(samples), "ball_position": shifted}), header

    dataset = collection.collect(tmp_path / "dataset", change=early)
    (lost,) = repair(dataset, output, remake=never).lost
    assert lost.trial == 2
    assert "departs from ballistic motion" in lost.reason
    assert verify(output) == []


def test_repair_leaves_out_an_episode_of_a_trial_that_is_not_in_the_plan(
    make_collection: Any, dataset: Path, output: Path
) -> None:
    more = make_collection({"trials": 9}).collect(dataset.parent / "more")
    (dataset / "quick_00002.mcap").write_bytes((more / "quick_00002.mcap").read_bytes())
    repaired = repair(dataset, output, remake=never)
    assert [remark.partition(": ")[0] for remark in repaired.remarks] == ["quick_00002.mcap"] * 2
    assert "an episode of trial 8, which the plan does not run" in repaired.remarks[1]
    assert repaired.lost == ()


def scale_efforts(samples: Any, header: Any) -> Any:
    """Other efforts for trial 4, which only the digest of the table contradicts."""
    return replace(samples, effort=samples.effort * (1.01 if header.trial == 4 else 1.0)), header


def test_repair_takes_the_episode_with_the_digest_of_the_table_from_any_file(
    make_collection: Any, collected: Path, dataset: Path, output: Path
) -> None:
    other = make_collection().collect(dataset.parent / "other", change=scale_efforts)
    (dataset / SHARD).rename(dataset / "quick_00007.mcap")
    shutil.copy(other / SHARD, dataset / SHARD)
    right, wrong = digest_of(dataset, 4), digest_of(other, 4)
    repaired = repair(dataset, output, remake=never)
    assert (repaired.episodes, repaired.lost, repaired.differing) == (7, (), ())
    assert same_files(output, collected)
    told = [remark for remark in repaired.remarks if "trial 4" in remark]
    assert told == [
        f"{SHARD}: trial 4: an episode with digest {wrong}, not {right} as in throws.parquet; "
        "the right one was taken from quick_00007.mcap"
    ]


def test_repair_keeps_an_episode_that_differs_from_the_table_with_a_remark(
    make_collection: Any, dataset: Path, output: Path
) -> None:
    other = make_collection().collect(dataset.parent / "other", change=scale_efforts)
    shutil.copy(other / SHARD, dataset / SHARD)
    right, wrong = digest_of(dataset, 4), digest_of(other, 4)
    repaired = repair(dataset, output, remake=never)
    assert (repaired.episodes, repaired.lost) == (7, ())
    assert repaired.differing == (DifferingEpisode(4, SHARD, digest=wrong, expected=right),)
    assert repaired.remarks == (
        f"{SHARD}: trial 4: an episode with digest {wrong}, not {right} as in throws.parquet; kept, as it passes "
        "all other checks",
    )
    assert verify(output) == []


def test_repair_reads_a_swapped_recording_once_more_and_not_once_for_each_episode(
    make_collection: Any, dataset: Path, output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = make_collection().collect(
        output.with_name("other"),
        range(7),
        change=lambda samples, header: (replace(samples, effort=samples.effort * 1.01), header),
    )
    shutil.copy(other / SHARD, dataset / SHARD)
    scanned = []

    def scan(path: Path) -> Any:
        for found in scan_whole(path):
            scanned.append(path.name)
            yield found

    monkeypatch.setattr("throwcollect.dataset.repair.scan_whole", scan)
    repaired = repair(dataset, output, remake=never)
    assert len(repaired.differing) > 1
    assert scanned.count(SHARD) == 2 * len(repaired.differing)


def test_an_episode_is_found_again_wherever_the_one_found_before_lies(dataset: Path) -> None:
    stored = [found.stored.episode for found in scan_whole(dataset / SHARD)]
    wanted = [DifferingEpisode(episode.header.trial, SHARD, episode.digest, "") for episode in stored]
    reading: dict[Path, Any] = {}
    for index in (1, 0, 2):
        assert _find_again(dataset / SHARD, wanted[index], reading).digest == stored[index].digest
    with pytest.raises(DatasetError, match="was changed while it was read"):
        _find_again(dataset / SHARD, replace(wanted[0], digest=""), reading)


def test_repair_without_a_table_reports_no_differing_episode(make_collection: Any, dataset: Path, output: Path) -> None:
    other = make_collection().collect(dataset.parent / "other", change=scale_efforts)
    shutil.copy(other / SHARD, dataset / SHARD)
    (dataset / "throws.parquet").unlink()
    assert repair(dataset, output, remake=never).remarks == ()


def test_repair_makes_a_damaged_plan_again_from_the_table_of_throws(
    collected: Path, dataset: Path, output: Path
) -> None:
    flip(dataset / "plan.parquet", 60)
    repaired = repair(dataset, output, remake=never)
    assert len(repaired.remarks) == 1
    assert repaired.remarks[0].startswith("plan.parquet: is damaged: ")
    assert repaired.remarks[0].endswith("made again from throws.parquet")
    assert same_files(output, collected)


def test_repair_makes_a_changed_plan_again(collected: Path, dataset: Path, output: Path) -> None:
    table = pq.read_table(dataset / "plan.parquet")
    values = table["task.duration_s"].to_pylist()
    changed = table.set_column(4, table.schema.field(4), [[*values[:5], 1.0, *values[6:]]])
    pq.write_table(changed, dataset / "plan.parquet")
    repaired = repair(dataset, output, remake=never)
    (remark,) = repaired.remarks
    assert remark.startswith(
        "plan.parquet: trial 5 has another digest than its values and seed; made again from throws"
    )
    assert same_files(output, collected)


def test_a_plan_made_again_from_the_table_keeps_its_refusals(collection: Any, tmp_path: Path, output: Path) -> None:
    collection.refuse(6, "too fast")
    dataset = collection.collect(tmp_path / "dataset", range(6))
    kept = tmp_path / "kept.parquet"
    (dataset / "plan.parquet").rename(kept)
    assert repair(dataset, output, remake=never).lost == ()
    assert (output / "plan.parquet").read_bytes() == kept.read_bytes()


def test_repair_draws_the_plan_again_if_plan_and_table_are_lost(collected: Path, dataset: Path, output: Path) -> None:
    flip(dataset / "plan.parquet", 60)
    (dataset / "throws.parquet").unlink()
    repaired = repair(dataset, output, remake=make_plan)
    assert repaired.remarks[0].endswith("made again from config.yaml")
    assert same_files(output, collected)


def test_repair_without_any_source_of_the_plan_is_an_error(dataset: Path, output: Path) -> None:
    (dataset / "plan.parquet").unlink()
    (dataset / "throws.parquet").unlink()
    with pytest.raises(DatasetError, match=f"it cannot be drawn again either\n  evidence: {NO_PLAN}"):
        repair(dataset, output, remake=never)
    assert not output.exists()


def test_repair_of_a_directory_without_a_dataset_says_so(tmp_path: Path, output: Path) -> None:
    for place in (tmp_path, tmp_path / "gone"):
        with pytest.raises(DatasetError, match=r": holds no dataset$"):
            repair(place, output, remake=never)


def test_repair_without_a_usable_configuration_is_an_error(dataset: Path, output: Path) -> None:
    (dataset / "config.yaml").write_text("trials: many\n")
    with pytest.raises(DatasetError, match=r"nothing else holds the configuration[^$]*copy the YAML file"):
        repair(dataset, output, remake=never)


def test_repair_refuses_a_configuration_that_does_not_fit_the_plan(dataset: Path, output: Path) -> None:
    text = (dataset / "config.yaml").read_text()
    (dataset / "config.yaml").write_text(text.replace("seed: 0", "seed: 1"))
    with pytest.raises(DatasetError, match="one of the two was changed"):
        repair(dataset, output, remake=never)


def test_repair_refuses_a_used_output_directory_and_keeps_its_files(dataset: Path, output: Path) -> None:
    output.mkdir()
    (output / "mine").write_text("")
    with pytest.raises(ConfigError, match="new or empty"):
        repair(dataset, output, remake=never)
    assert [path.name for path in output.iterdir()] == ["mine"]


def test_repair_keeps_every_whole_episode_of_a_cut_recording(dataset: Path, output: Path) -> None:
    data = (dataset / SHARD).read_bytes()
    (dataset / SHARD).write_bytes(data[: len(data) * 2 // 3])
    found = [each.stored.episode.header.trial for each in scan_whole(dataset / SHARD)]
    assert found == [3, 4]
    assert [lost.trial for lost in repair(dataset, output, remake=never).lost] == [5]
