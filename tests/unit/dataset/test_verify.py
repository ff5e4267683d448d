"""Verify finds each planted defect, and names its file and place."""

from __future__ import annotations

import json
import os
import re
import struct
import zlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import zstandard
from tests.unit.dataset.damage import SHARD, find_stored, flip, replace_text
from tests.unit.dataset.mutations import fit_manifest
from tests.unit.dataset.shard_defects import (
    SHARD_CONSEQUENCES,
    SHARD_DEFECTS,
    damage_chunk_contents,
    zero_sector,
)
from tests.unit.dataset.table_defects import (
    TABLE_CONSEQUENCES,
    TABLE_DEFECTS,
    break_bag_yaml,
    break_config,
    change_landing,
    change_plan_seed,
    damage_plan,
    damage_table,
    delete_card,
)

from throwcollect.dataset.creation import create
from throwcollect.dataset.inspect import digest
from throwcollect.dataset.mcap_reader import map_file
from throwcollect.dataset.verify import verify
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.episode.topics import joint_states
from throwcollect.errors import DatasetError
from throwcollect.robots.talos import TALOS

DEFECTS = {**SHARD_DEFECTS, **TABLE_DEFECTS}
CONSEQUENCES = {**SHARD_CONSEQUENCES, **TABLE_CONSEQUENCES}


def test_a_sound_dataset_has_no_findings(dataset: Path) -> None:
    assert verify(dataset) == []


def test_a_hole_of_a_terabyte_is_not_read(dataset: Path) -> None:
    size = (dataset / SHARD).stat().st_size
    os.truncate(dataset / SHARD, 1 << 40)
    findings = verify(dataset)
    assert {finding.file for finding in findings} == {SHARD}
    assert f"has {1 << 40} bytes, in datapackage.json {size}" in [finding.problem for finding in findings]
    with map_file(dataset / SHARD) as contents:
        assert size < len(contents) <= 2 * (size + 4096) + 1


def test_verify_with_several_processes_gives_the_same_findings(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    class Pool(ProcessPoolExecutor):
        def __init__(self, processes: int, *others: Any) -> None:
            super().__init__(processes, *others)
            started.append(processes)

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    zero_sector(dataset)
    alone = verify(dataset, processes=2)
    assert (len(alone), started) == (len(verify(dataset)), [])
    monkeypatch.setattr("throwcollect.dataset.verify._MANY_EPISODES", 1)
    assert verify(dataset, processes=2) == alone != []
    assert started == [2]


@pytest.mark.parametrize("plant", DEFECTS, ids=lambda plant: plant.__name__)
def test_a_planted_defect_is_found_and_named(dataset: Path, plant: Callable[[Path], None]) -> None:
    plant(dataset)
    fit_manifest(dataset)
    file, place, problem = DEFECTS[plant]
    findings = verify(dataset)
    assert [
        finding
        for finding in findings
        if finding.file == file and place in finding.place and re.search(problem, finding.problem)
    ], "\n".join(map(str, findings))
    assert {finding.file for finding in findings} <= {file, *CONSEQUENCES.get(plant, ())}
    assert json.loads(json.dumps([asdict(finding) for finding in findings]))


def test_a_single_defect_gives_a_single_finding(dataset: Path) -> None:
    change_landing(dataset)
    fit_manifest(dataset)
    (finding,) = verify(dataset)
    assert str(finding).startswith("quick_00000.mcap: trial 2: throws.parquet has landing_x_m = 1.25")


def test_damaged_tables_do_not_keep_other_files_from_being_checked(dataset: Path) -> None:
    for plant in (damage_chunk_contents, zero_sector, break_bag_yaml, damage_table, change_plan_seed, delete_card):
        plant(dataset)
    (dataset / "quick_00000.mcap").write_bytes((dataset / "quick_00000.mcap").read_bytes()[:-9])
    found = {(finding.file, finding.place.partition(" ")[0]) for finding in verify(dataset)}
    assert found >= {
        ("metadata.yaml", ""),
        ("throws.parquet", ""),
        ("plan.parquet", "trial"),
        (SHARD, "byte"),
        ("quick_00000.mcap", "byte"),
        ("README.md", ""),
    }


def test_recordings_are_checked_even_without_plan_and_configuration(dataset: Path) -> None:
    break_config(dataset)
    damage_plan(dataset)
    damage_chunk_contents(dataset)
    found = {(finding.file, finding.place) for finding in verify(dataset)}
    assert ("config.yaml", "line 1") in found
    assert (SHARD, "trial 4") in found
    assert not any(file in ("quick_00000.mcap", "quick_00002.mcap", "metadata.yaml") for file, _ in found)


def test_a_damaged_stretch_is_reported_with_its_end_and_hides_no_later_defect(dataset: Path) -> None:
    zero_sector(dataset)
    second, third = (pq.read_table(dataset / "throws.parquet")["chunk_offset"].to_pylist()[trial] for trial in (4, 5))
    flip(dataset / SHARD, third + 2000)
    fit_manifest(dataset)
    findings = verify(dataset)
    assert [finding.place for finding in findings] == [f"byte {second}", "trial 5", "trial 4"]
    assert findings[0].problem.endswith(f"the next episode is at byte {third}")


def test_a_changed_sample_is_found_although_its_crc_fits(dataset: Path) -> None:
    """One number of a chunk is changed, with its CRC and size: the SHA-256 still differs."""
    path = dataset / SHARD
    episode = find_stored(path, 4)
    contents = bytearray(episode.episode.chunk.decompress())
    contents[31 + joint_states(TALOS.joints).layout.dtype.fields["position"][1]] ^= 0x40
    data = zstandard.ZstdCompressor(level=1).compress(bytes(contents))
    chunk = replace(episode.episode.chunk, data=data, crc=zlib.crc32(contents)).record()
    whole = path.read_bytes()
    path.write_bytes(whole[: episode.offset] + chunk + whole[episode.chunks[0].record.end :])
    problems = [str(finding) for finding in verify(dataset)]
    assert any("SHA-256 of its records is" in problem for problem in problems)
    with pytest.raises(DatasetError, match="trial 4: chunk: SHA-256 of its records is"):
        digest(dataset)


def kick_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """In the middle of the flight the ball gains a micrometre per second without a contact."""
    if header.trial != 2:
        return samples, header
    half = (len(samples) + 100) // 2
    seconds = np.maximum(0, np.arange(len(samples)) - half) / 250
    position = samples.ball_position + 1e-6 * seconds[:, np.newaxis] * np.array([1.0, 0, 0])
    return replace(samples, ball_position=position), header


def leave_out_a_sample(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """One sample is missing."""
    if header.trial != 2:
        return samples, header
    kept = np.delete(np.arange(len(samples)), 40)
    return Samples(**{name: column[kept] for name, column in vars(samples).items()}), replace(header, samples=len(kept))


def late(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The trial and its contacts are 1 ns late in their slot of time."""
    if header.trial != 2:
        return samples, header
    contacts = tuple(
        replace(each, start_ns=each.start_ns + 1, end_ns=each.end_ns and each.end_ns + 1) for each in header.contacts
    )
    header = replace(header, start_ns=header.start_ns + 1, contacts=contacts)
    return replace(samples, stamps_ns=samples.stamps_ns + 1), header


def early(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The header says that the trial began before its first sample."""
    return samples, replace(header, start_ns=header.start_ns - (header.trial == 2))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (kick_ball, "departs from ballistic motion by"),
        (leave_out_a_sample, "not spaced by 1/250 s"),
        (early, "times differ: header"),
        (late, "the trial's slot of time"),
    ],
)
def test_an_episode_that_contradicts_physics_or_its_header_is_found(
    collection: Any, tmp_path: Path, change: Any, problem: str
) -> None:
    findings = verify(collection.collect(tmp_path / "dataset", change=change))
    assert {(finding.file, finding.place) for finding in findings} == {("quick_00000.mcap", "trial 2")}
    assert any(problem in finding.problem for finding in findings)


def test_latched_topics_of_another_robot_are_found(
    make_collection: Any, collection: Any, tmp_path: Path, dataset: Path
) -> None:
    """A shard recorded with another height of the base: only its static transforms differ."""
    other = make_collection({"robot": {"base_height_m": 1.1}}).collect(tmp_path / "other")
    (dataset / SHARD).write_bytes((other / SHARD).read_bytes())
    assert any("/tf_static does not fit" in str(finding) for finding in verify(dataset))


def test_a_recording_cut_anywhere_is_reported_without_an_exception(dataset: Path) -> None:
    whole = (dataset / "quick_00002.mcap").read_bytes()
    for size in (0, 8, 17, 40, 5000, len(whole) // 2, len(whole) - 30, len(whole) - 1):
        (dataset / "quick_00002.mcap").write_bytes(whole[:size])
        assert any(finding.file == "quick_00002.mcap" for finding in verify(dataset)), size


def test_random_damage_is_always_reported_without_an_exception(make_collection: Any, tmp_path: Path) -> None:
    path = make_collection({"trials": 1}).collect(tmp_path / "dataset") / "quick_00000.mcap"
    whole = path.read_bytes()
    random = np.random.default_rng(0)
    for offset in random.integers(8, len(whole), size=20).tolist():
        flip(path, offset, bit=1 << int(random.integers(8)))
        assert any(finding.file == path.name for finding in verify(path.parent)), offset
        path.write_bytes(whole)


def test_a_chunk_that_announces_a_huge_size_is_reported(dataset: Path) -> None:
    path = dataset / SHARD
    chunk = find_stored(path, 4).chunks[0].record
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, chunk.offset + 9 + 16, 1 << 62)
    path.write_bytes(data)
    assert any("as announced" in str(finding) for finding in verify(dataset))


def test_a_list_as_file_name_in_metadata_is_reported_beside_a_damaged_file(dataset: Path) -> None:
    (dataset / "quick_00000.mcap").write_bytes(b"")
    replace_text(dataset / "metadata.yaml", "path: quick_00001.mcap", "path: [1]")
    assert ("metadata.yaml", "files: quick_00001.mcap") in {(each.file, each.place) for each in verify(dataset)}


def test_verify_of_an_unfinished_dataset_is_an_error(collection: Any, tmp_path: Path) -> None:
    create(tmp_path / "dataset", collection.plan)
    with pytest.raises(DatasetError, match="is not finished"):
        verify(tmp_path / "dataset")
