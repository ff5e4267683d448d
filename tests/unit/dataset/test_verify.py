"""Verify finds each change of a dataset, also where the manifest was fitted to it, and names file and place."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.opcode import Opcode
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import SHARD, change_table, find_stored, flip, record_of, replace_text
from tests.unit.dataset.mutations import fit_manifest

from throwcollect.config.loader import load
from throwcollect.dataset.creation import create
from throwcollect.dataset.mcap_file import McapFile, episode_run
from throwcollect.dataset.mcap_reader import map_file
from throwcollect.dataset.verify import verify
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description

THROWS, PLAN, METADATA = "throws.parquet", "plan.parquet", "metadata.yaml"
Change = Callable[[Path], object]


def test_a_sound_dataset_has_no_findings(dataset: Path) -> None:
    assert verify(dataset) == []


def test_a_flipped_bit_in_every_file_is_found(dataset: Path) -> None:
    random = np.random.default_rng(0)
    for path in sorted(path for path in dataset.iterdir() if path.is_file()):
        whole = path.read_bytes()
        for offset in random.integers(len(whole), size=2).tolist():
            flip(path, offset, bit=1 << int(random.integers(8)))
            # A changed hash in the manifest or the provenance is a finding of the file that it is of.
            assert verify(dataset), (path.name, offset)
            path.write_bytes(whole)
    assert verify(dataset) == []


@pytest.mark.parametrize(
    "name",
    ["README.md", "config.yaml", "datapackage.json", PLAN, "provenance.json", SHARD, THROWS],
)
def test_a_deleted_file_is_found(dataset: Path, name: str) -> None:
    (dataset / name).unlink()
    findings = verify(dataset)
    assert (name, "", "missing") in {
        (each.file, each.place, re.findall("missing|$", each.problem)[0]) for each in findings
    }


@pytest.mark.parametrize(
    "name", ["quick_00003.mcap", "quick_00003.mcap.part", "throws.parquet.new", "sources.parquet", "trials.parquet"]
)
def test_an_added_file_that_passes_for_a_part_of_the_dataset_is_found(dataset: Path, name: str) -> None:
    (dataset / name).write_bytes((dataset / SHARD).read_bytes())
    (dataset / "notes.txt").write_text("of the user")
    assert (name, "is not in datapackage.json") in {(each.file, each.problem) for each in verify(dataset)}
    assert "notes.txt" not in {each.file for each in verify(dataset)}


def change(column: str, row: int, value: object, *, table: str = THROWS) -> Change:
    return lambda directory: change_table(directory / table, column, row, value)


def take_rows(*rows: int) -> Change:
    return lambda directory: pq.write_table(pq.read_table(directory / THROWS).take(rows), directory / THROWS)


def nudge_landing(directory: Path) -> None:
    landing = pq.read_table(directory / THROWS)["landing_x_m"][2].as_py()
    change_table(directory / THROWS, "landing_x_m", 2, landing + 1e-8)


def lose_row(directory: Path) -> None:
    for column, value in (("outcome", "lost"), ("shard", None), ("chunk_offset", None), ("samples", None)):
        change_table(directory / THROWS, column, 4, value)
    change_table(directory / THROWS, "digest", 4, None)


def change_unit(directory: Path) -> None:
    table = pq.read_table(directory / THROWS)
    index = table.schema.get_field_index("task_duration_s")
    field = table.schema.field(index)
    other = field.with_metadata({**field.metadata, b"unit": b"ms"})
    pq.write_table(table.set_column(index, other, table.column(index)), directory / THROWS)


def text(name: str, old: str, new: str) -> Change:
    return lambda directory: replace_text(directory / name, old, new)


def in_record(opcode: Opcode, place: int, *, last: bool = False) -> Change:
    return lambda directory: flip(directory / SHARD, record_of(directory / SHARD, opcode, last=last).offset + place)


def in_index(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 5).chunk.end + 200)


def in_chunk(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset + 2000)


def in_header(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 3).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b'"end_ns":64400000000') + len('"end_ns":64400000000') - 1)


def in_digest(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 3).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b"digest") + 12)


def append_bytes(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data + data[-8:])


def write_episodes(*order: int) -> Change:
    """Write the shard again with the first, second and third of its episodes in this order; 3 is another one's."""

    def write(directory: Path) -> None:
        episodes: list[Episode] = [find_stored(directory / SHARD, trial).episode for trial in (3, 4, 5)]
        episodes.append(Collection({"ball": {"mass_kg": 0.1}, "seed": 1}).episode(4))
        config = load(directory / "config.yaml")
        channels = Channels(config, full_description(config))
        with (directory / SHARD).open("wb") as file:
            mcap = McapFile(file.write, channels, start_ns=episodes[order[0]].chunk.start_ns)
            for number in order:
                mcap.append(episode_run(episodes[number]))
            mcap.finish(SHARD)

    return write


def swap_shards(directory: Path) -> None:
    one, other = (directory / "quick_00000.mcap").read_bytes(), (directory / SHARD).read_bytes()
    (directory / "quick_00000.mcap").write_bytes(other)
    (directory / SHARD).write_bytes(one)


CHANGES: dict[str, tuple[Change, str, str, str]] = {
    "landing": (change("landing_x_m", 2, 1.25), "quick_00000.mcap", "trial 2", r"landing_x_m = 1\.25 instead of"),
    "nudged landing": (nudge_landing, "quick_00000.mcap", "trial 2", "throws.parquet has landing_x_m"),
    "outcome": (change("outcome", 4, "timeout"), SHARD, "trial 4", "outcome = 'timeout' instead of 'landed'"),
    "row's digest": (change("digest", 4, "0" * 64), SHARD, "trial 4", "digest = '000"),
    "row's offset": (change("chunk_offset", 4, 17), SHARD, "trial 4", "chunk_offset = 17"),
    "row's value": (change("task_duration_s", 6, 0.9), "quick_00002.mcap", "trial 6", r"task_duration_s = 0\.9"),
    "lost row": (lose_row, SHARD, "byte", "does not place here: trial 4"),
    "refused row": (change("outcome", 6, "refused"), "quick_00002.mcap", "trial 6", "outcome = 'refused'"),
    "removed row": (take_rows(0, 1, 2, 3, 4, 5), THROWS, "", "not the 7 trials of the plan"),
    "order of rows": (take_rows(0, 1, 2, 4, 3, 5, 6), THROWS, "", "in order"),
    "unit": (change_unit, THROWS, "task_duration_s", "has the unit b'ms'"),
    "planned value": (change("task.duration_s", 5, 1.0, table=PLAN), PLAN, "trial 5", "its values and seed give"),
    "planned seed": (change("seed", 5, 42, table=PLAN), PLAN, "trial 5", "its values and seed give"),
    "seed": (text("config.yaml", "seed: 0", "seed: 1"), "config.yaml", "", "one of the two was changed"),
    "key": (text("config.yaml", "seed: 0", "sead: 0"), "config.yaml", "line", "sead"),
    "digest": (text(METADATA, "digest: ", "digest: 0000"), METADATA, "line", "the recordings give"),
    "count": (text(METADATA, "message_count: ", "message_count: 1"), METADATA, "line", "the recordings give"),
    "section": (text(METADATA, "ros_distro", "colour: red\n  ros_distro"), METADATA, "line", "colour"),
    "broken YAML": (text(METADATA, "version: 9", "version: ["), METADATA, "line", "cannot be read"),
    "chunk": (in_chunk, SHARD, "trial 4", "no whole episode: chunk"),
    "header of episode": (in_header, SHARD, "trial 3", "no whole episode: the digest is not that of the header"),
    "digest of episode": (in_digest, SHARD, "trial 3", "no whole episode"),
    "message index": (in_index, SHARD, "trial 5", "the message indexes or the metadata do not fit the chunk"),
    "profile": (in_record(Opcode.HEADER, 9 + 4), SHARD, "byte 0", "not what is written"),
    "statistics": (in_record(Opcode.STATISTICS, 9), SHARD, "byte", "not what is written"),
    "chunk index": (in_record(Opcode.CHUNK_INDEX, 25, last=True), SHARD, "byte", "not what is written"),
    "data CRC": (in_record(Opcode.DATA_END, 9), SHARD, "byte", "not what is written"),
    "footer": (in_record(Opcode.FOOTER, 9 + 16), SHARD, "byte", "not what is written"),
    "appended bytes": (append_bytes, SHARD, "byte", "not what is written"),
    "repeated episode": (write_episodes(0, 1, 1, 2), SHARD, "byte", "does not place here: trial 4"),
    "order of episodes": (write_episodes(0, 2, 1), SHARD, "trial 4", "chunk_offset"),
    "missing episode": (write_episodes(0, 2), SHARD, "trial 4", "no whole episode: at byte [0-9]+ is another one"),
    "episode of another dataset": (write_episodes(0, 3, 2), SHARD, "trial 4", "more columns differ"),
    "swapped recordings": (swap_shards, SHARD, "trial 4", "no whole episode"),
}
"""Each with file, place and problem of a finding that it must give."""


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_to_which_the_manifest_was_fitted_is_found(dataset: Path, name: str) -> None:
    plant, file, place, problem = CHANGES[name]
    plant(dataset)
    fit_manifest(dataset)
    findings = verify(dataset)
    assert [
        finding
        for finding in findings
        if finding.file == file and place in finding.place and re.search(problem, finding.problem)
    ], "\n".join(map(str, findings))


def test_one_change_gives_one_finding(dataset: Path) -> None:
    change("landing_x_m", 2, 1.25)(dataset)
    fit_manifest(dataset)
    (finding,) = verify(dataset)
    assert str(finding).startswith("quick_00000.mcap: trial 2: throws.parquet has landing_x_m = 1.25")


def test_a_table_that_cannot_be_read_hides_no_change_of_another_file(dataset: Path) -> None:
    for name in ("config.yaml", THROWS, SHARD, METADATA):
        flip(dataset / name, 60)
    (dataset / "README.md").unlink()
    assert {finding.file for finding in verify(dataset)} >= {"config.yaml", THROWS, SHARD, METADATA, "README.md"}


def test_verify_with_several_processes_gives_the_same_findings(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    class Pool(ProcessPoolExecutor):
        def __init__(self, processes: int, *others: Any) -> None:
            super().__init__(processes, *others)
            started.append(processes)

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    in_chunk(dataset)
    alone = verify(dataset, processes=2)
    assert (len(alone), started) == (len(verify(dataset)), [])
    monkeypatch.setattr("throwcollect.dataset.verify._MANY_EPISODES", 1)
    assert verify(dataset, processes=2) == alone != []
    assert started == [2]


def test_a_hole_of_a_terabyte_is_not_read(dataset: Path) -> None:
    size = (dataset / SHARD).stat().st_size
    os.truncate(dataset / SHARD, 1 << 40)
    findings = verify(dataset)
    assert {finding.file for finding in findings} == {SHARD}
    assert f"has {1 << 40} bytes, in datapackage.json {size}" in [finding.problem for finding in findings]
    with map_file(dataset / SHARD) as contents:
        assert size < len(contents) <= 2 * (size + 4096) + 1


def kick_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """In the middle of the flight the ball gains a micrometre per second without a contact."""
    half = (len(samples) + 100) // 2
    seconds = np.maximum(0, np.arange(len(samples)) - half) / 250
    position = samples.object_position + 1e-6 * seconds[:, np.newaxis] * np.array([1.0, 0, 0])
    return replace(samples, object_position=position), header


def late(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The trial is 1 ns late in its slot of time."""
    header = replace(header, start_ns=header.start_ns + 1)
    return replace(samples, stamps_ns=samples.stamps_ns + 1), header


def spoil_effort(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    effort = samples.effort.copy()
    effort[40, 3] = np.nan
    return replace(samples, effort=effort), header


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (kick_ball, "departs from ballistic motion by"),
        (late, "the trial's slot of time"),
        (spoil_effort, "effort holds numbers that are not finite, first in sample 40"),
    ],
)
def test_an_episode_that_no_simulation_records_is_found(
    collection: Collection, tmp_path: Path, change: Any, problem: str
) -> None:
    def change_one(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        return change(samples, header) if header.trial == 2 else (samples, header)

    findings = verify(collection.collect(tmp_path / "dataset", change=change_one))
    assert {(finding.file, finding.place) for finding in findings} == {("quick_00000.mcap", "trial 2")}
    assert any(problem in finding.problem for finding in findings)


def test_verify_of_an_unfinished_dataset_is_an_error(collection: Collection, tmp_path: Path) -> None:
    create(tmp_path / "dataset", collection.plan)
    with pytest.raises(DatasetError, match="is not finished"):
        verify(tmp_path / "dataset")
