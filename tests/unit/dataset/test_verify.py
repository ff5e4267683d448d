"""Verify finds each change of a dataset, also where the manifest was fitted to it, and names file and place."""

from __future__ import annotations

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
from tests.unit.dataset.damage import SHARD, change_table, find_facts, find_stored, flip, record_of, replace_text
from tests.unit.dataset.mutations import fit_manifest

from throwcollect.config.loader import load
from throwcollect.dataset.mcap_file import McapFile, episode_run
from throwcollect.dataset.verify import verify
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.robots.description import full_description

THROWS, PLAN, METADATA = "throws.parquet", "plan.parquet", "metadata.yaml"
Change = Callable[[Path], object]


def test_a_sound_dataset_has_no_findings(dataset: Path) -> None:
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


def in_record(opcode: Opcode, place: int) -> Change:
    return lambda directory: flip(directory / SHARD, record_of(directory / SHARD, opcode).offset + place)


def in_index(directory: Path) -> None:
    run = find_stored(directory / SHARD, 5).run
    flip(directory / SHARD, run.offset + run.chunk_indexes[0].chunk_length + 200)


def in_chunk(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).run.offset + 2000)


def in_header(directory: Path) -> None:
    end_ns = b'"end_ns":64400000000'
    flip(directory / SHARD, find_facts(directory / SHARD, 3, end_ns) + len(end_ns) - 1)


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


CHANGES: dict[str, tuple[Change, str, str, str]] = {
    "landing": (change("landing_x_m", 2, 1.25), "quick_00000.mcap", "trial 2", r"landing_x_m = 1\.25 instead of"),
    "outcome": (change("outcome", 4, "timeout"), SHARD, "trial 4", "outcome = 'timeout' instead of 'landed'"),
    "lost row": (lose_row, SHARD, "byte", "does not place here: trial 4"),
    "unit": (change_unit, THROWS, "task_duration_s", "has the unit b'ms'"),
    "removed row": (take_rows(0, 1, 2, 3, 4, 5), THROWS, "", "not the 7 trials of the plan"),
    "planned value": (change("task.duration_s", 5, 1.0, table=PLAN), PLAN, "trial 5", "its values and seed give"),
    "seed": (text("config.yaml", "seed: 0", "seed: 1"), "config.yaml", "", "one of the two was changed"),
    "key": (text("config.yaml", "seed: 0", "sead: 0"), "config.yaml", "line", "sead"),
    "digest": (text(METADATA, "digest: ", "digest: 0000"), METADATA, "line", "the recordings give"),
    "broken YAML": (text(METADATA, "version: 9", "version: ["), METADATA, "line", "cannot be read"),
    "chunk": (in_chunk, SHARD, "trial 4", "no whole episode: chunk"),
    "header of episode": (in_header, SHARD, "trial 3", "no whole episode: its message indexes or"),
    "message index": (in_index, SHARD, "trial 5", "no whole episode: its message indexes or metadata do not fit"),
    "profile": (in_record(Opcode.HEADER, 9 + 4), SHARD, "byte 0", "not what is written"),
    "footer": (in_record(Opcode.FOOTER, 9 + 16), SHARD, "byte", "not what is written"),
    "repeated episode": (write_episodes(0, 1, 1, 2), SHARD, "byte", "does not place here: trial 4"),
    "order of episodes": (write_episodes(0, 2, 1), SHARD, "trial 4", "chunk_offset"),
    "missing episode": (write_episodes(0, 2), SHARD, "trial 4", "no whole episode: at byte [0-9]+ is another one"),
    "episode of another dataset": (write_episodes(0, 3, 2), SHARD, "trial 4", "more columns differ"),
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


def test_verify_with_several_processes_gives_the_same_findings(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    class Pool(ProcessPoolExecutor):
        def __init__(self, processes: int, *others: Any) -> None:
            super().__init__(processes, *others)
            started.append(processes)

    monkeypatch.setattr("throwcollect.side_by_side.futures.ProcessPoolExecutor", Pool)
    in_chunk(dataset)
    alone = verify(dataset, processes=2)
    assert (len(alone), started) == (len(verify(dataset)), [])
    monkeypatch.setattr("throwcollect.dataset.verify._MANY_EPISODES", 1)
    assert verify(dataset, processes=2) == alone != []
    assert started == [2]


def kick_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """In the middle of the flight the ball gains a micrometre per second without a contact."""
    half = (len(samples) + 100) // 2
    seconds = np.maximum(0, np.arange(len(samples)) - half) / 250
    position = samples.object_position + 1e-6 * seconds[:, np.newaxis] * np.array([1.0, 0, 0])
    return replace(samples, object_position=position), header


def forget_contacts(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The ball stands still in the air, as no contact with the tool is recorded."""
    return samples, replace(header, contacts=())


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
        (kick_ball, "the ball departs from ballistic motion by"),
        (forget_contacts, "the ball departs from ballistic motion by"),
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
