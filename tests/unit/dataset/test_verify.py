"""Each defect that is planted is found, and named with its file and place."""

from __future__ import annotations

import hashlib
import json
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard
from mcap.opcode import Opcode
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.mutations import fit_manifest

from throwcollect.config.loader import load
from throwcollect.dataset.inspect import digest
from throwcollect.dataset.mcap_file import McapFile, episode_run
from throwcollect.dataset.mcap_reader import Record, StoredEpisode, open_mcap
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import create
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.episode.topics import joint_states
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description
from throwcollect.robots.talos import TALOS

SHARD = "quick_00001.mcap"
FIRST = 3
"""First trial of that shard."""


def stored(path: Path, trial: int) -> StoredEpisode:
    offset = pq.read_table(path.parent / "throws.parquet")["chunk_offset"].to_pylist()[trial]
    with open_mcap(path) as contents:
        return contents.episode(offset)


def record_of(path: Path, opcode: Opcode, *, holding: bytes = b"", last: bool = False) -> Record:
    with open_mcap(path) as contents:
        found = [record for record in contents.records() if record.opcode == opcode and holding in record.data]
    return found[-1] if last else found[0]


def flip(path: Path, offset: int, bit: int = 1) -> None:
    data = bytearray(path.read_bytes())
    data[offset] ^= bit
    path.write_bytes(data)


def change_table(path: Path, column: str, row: int, value: object) -> None:
    table = pq.read_table(path)
    values = table[column].to_pylist()
    values[row] = value
    index = table.schema.get_field_index(column)
    pq.write_table(
        table.set_column(index, table.schema.field(index), pa.array(values, table.schema.types[index])), path
    )


def replace_text(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def chunk_contents(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).offset + 2000)


def chunk_crc(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).offset + 9 + 24)


def chunk_end_time(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).offset + 9 + 8)


def message_index(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 5).chunks[0].indexes[4].offset + 200)


def stored_digest(directory: Path) -> None:
    facts = stored(directory / SHARD, 3).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b"digest") + 12)


def records_hash(directory: Path) -> None:
    facts = stored(directory / SHARD, 3).facts
    place = facts.offset + facts.data.index(b"records_sha256") + len(b"records_sha256") + 4
    data = bytearray((directory / SHARD).read_bytes())
    data[place] = ord("0") if data[place] != ord("0") else ord("1")
    (directory / SHARD).write_bytes(data)


def header_contact(directory: Path) -> None:
    facts = stored(directory / SHARD, 3).facts
    # The contact ends 1 ns later: valid, but not what was hashed.
    flip(directory / SHARD, facts.offset + facts.data.index(b'"end_ns":64400000000') + len('"end_ns":64400000000') - 1)


def torn(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data[: len(data) * 2 // 3])


def missing_footer(directory: Path) -> None:
    footer = record_of(directory / SHARD, Opcode.FOOTER)
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[: footer.offset])


def trailing_bytes(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data + data[-8:])


def statistics(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.STATISTICS).offset + 9)


def chunk_index(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.CHUNK_INDEX, last=True).offset + 9 + 16)


def footer_crc(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.FOOTER).offset + 9 + 16)


def data_crc(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.DATA_END).offset + 9)


def profile(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.HEADER).offset + 9 + 4)


def channel_qos(directory: Path) -> None:
    channel = record_of(directory / SHARD, Opcode.CHANNEL, holding=b"/ball/odometry")
    flip(directory / SHARD, channel.offset + channel.data.index(b"depth: 10") + 8)


def schema_name(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA)
    flip(directory / SHARD, schema.offset + 9 + 2 + 4, bit=0x20)


def bag_copy(directory: Path) -> None:
    copy = record_of(directory / SHARD, Opcode.METADATA, holding=b"serialized_metadata")
    flip(directory / SHARD, copy.offset + copy.data.index(b"version: 9") + 9)


def shard_gone(directory: Path) -> None:
    (directory / SHARD).unlink()


def shards_swapped(directory: Path) -> None:
    one, other = (directory / "quick_00000.mcap").read_bytes(), (directory / SHARD).read_bytes()
    (directory / "quick_00000.mcap").write_bytes(other)
    (directory / SHARD).write_bytes(one)


def measured_landing(directory: Path) -> None:
    change_table(directory / "throws.parquet", "landing_x_m", 2, 1.25)


def outcome(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "timeout")


def row_digest(directory: Path) -> None:
    change_table(directory / "throws.parquet", "digest", 4, "0" * 64)


def row_offset(directory: Path) -> None:
    change_table(directory / "throws.parquet", "chunk_offset", 4, 17)


def row_lost(directory: Path) -> None:
    for column, value in (("outcome", "lost"), ("shard", None)):
        change_table(directory / "throws.parquet", column, 4, value)


def row_invented(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 4, "lost")


def swept_value(directory: Path) -> None:
    change_table(directory / "throws.parquet", "task.duration_s", 6, 0.9)


def refused_row(directory: Path) -> None:
    change_table(directory / "throws.parquet", "outcome", 6, "refused")


def row_missing(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def plan_of_another(directory: Path) -> None:
    replace_text(directory / "config.yaml", "seed: 0", "seed: 1")


def config_broken(directory: Path) -> None:
    (directory / "config.yaml").write_text("trials: many\n")


def bag_count(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "message_count: ", "message_count: 1")


def bag_digest(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.digest: ", "throwcollect.digest: 0000")


def bag_qos(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "durability: transient_local", "durability: volatile")


def open_shard_left(directory: Path) -> None:
    (directory / "quick_00003.mcap.part").write_bytes(b"")


def card_gone(directory: Path) -> None:
    (directory / "README.md").unlink()


def written(path: Path, episodes: list[Episode]) -> None:
    """A file of these episodes, in which everything fits."""
    config = load(path.parent / "config.yaml")
    with path.open("wb") as file:
        mcap = McapFile(file.write, Channels(config, full_description(config)), start_ns=episodes[0].chunk.start_ns)
        for episode in episodes:
            mcap.append(episode_run(episode))
        mcap.finish(path.name)


def episodes_of(directory: Path) -> list[Episode]:
    return [stored(directory / SHARD, trial).episode for trial in (3, 4, 5)]


def duplicate_episode(directory: Path) -> None:
    first, second, third = episodes_of(directory)
    written(directory / SHARD, [first, second, second, third])


def episodes_in_another_order(directory: Path) -> None:
    first, second, third = episodes_of(directory)
    written(directory / SHARD, [first, third, second])


def episode_missing(directory: Path) -> None:
    first, _, third = episodes_of(directory)
    written(directory / SHARD, [first, third])


def episode_of_another_shard(directory: Path) -> None:
    first, second, _ = episodes_of(directory)
    written(directory / SHARD, [first, second, stored(directory / "quick_00000.mcap", 1).episode])


def episode_of_another_dataset(directory: Path) -> None:
    first, second, third = episodes_of(directory)
    other = Collection({"ball": {"mass_kg": 0.1}, "seed": 1}).episode(4)
    assert other.digest != second.digest
    written(directory / SHARD, [first, other, third])


def altered_with_all_hashes_made_to_fit(directory: Path) -> None:
    first, second, third = episodes_of(directory)
    contents = bytearray(second.chunk.decompress())
    contents[31 + joint_states(TALOS.joints).layout.dtype.fields["position"][1] + 6] ^= 1
    data = zstandard.ZstdCompressor(level=1).compress(bytes(contents))
    chunk = replace(second.chunk, data=data, crc=zlib.crc32(contents))
    written(directory / SHARD, [first, Episode(second.header, chunk, hashlib.sha256(contents).hexdigest()), third])


def schema_text(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA, holding=b"nav_msgs/msg/Odometry")
    flip(directory / SHARD, schema.end - 40)


def schema_length(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA, holding=b"nav_msgs/msg/Odometry")
    flip(directory / SHARD, schema.offset + 2)


def first_magic(directory: Path) -> None:
    flip(directory / SHARD, 3)


def last_magic(directory: Path) -> None:
    flip(directory / SHARD, (directory / SHARD).stat().st_size - 3)


def latched_chunk(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.CHUNK).end - 500)


def latched_index(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.MESSAGE_INDEX).offset + 15)


def chunk_opcode(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).offset, bit=0x10)


def chunk_length(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).offset + 2)


def index_length(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).chunks[0].indexes[4].offset + 2)


def metadata_name(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 4).facts.offset + 9 + 4)


def metadata_length(directory: Path) -> None:
    flip(directory / SHARD, stored(directory / SHARD, 5).facts.offset + 1)


def header_json(directory: Path) -> None:
    facts = stored(directory / SHARD, 4).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b'{"trial"'))


def zeroed_sector(directory: Path) -> None:
    data = bytearray((directory / SHARD).read_bytes())
    start = stored(directory / SHARD, 4).chunks[0].indexes[3].offset - 100
    data[start : start + 512] = bytes(512)
    (directory / SHARD).write_bytes(data)


def bytes_inserted(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    place = stored(directory / SHARD, 4).facts.end
    (directory / SHARD).write_bytes(data[:place] + b"between" + data[place:])


def cut_in_the_header(directory: Path) -> None:
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[:12])


def cut_in_the_first_episode(directory: Path) -> None:
    end = stored(directory / SHARD, 3).chunks[0].record.end
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[: end - 100])


def cut_after_an_episode(directory: Path) -> None:
    end = stored(directory / SHARD, 4).facts.end
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[:end])


def emptied(directory: Path) -> None:
    (directory / SHARD).write_bytes(b"")


def a_directory_instead(directory: Path) -> None:
    (directory / SHARD).unlink()
    (directory / SHARD).mkdir()


def summary_record_missing(directory: Path) -> None:
    path = directory / SHARD
    index = record_of(path, Opcode.CHUNK_INDEX, last=True)
    data = path.read_bytes()
    path.write_bytes(data[: index.offset] + data[index.end :])


def extra_shard(directory: Path) -> None:
    (directory / "quick_00003.mcap").write_bytes((directory / SHARD).read_bytes())


def new_file_left(directory: Path) -> None:
    (directory / "throws.parquet.new").write_bytes(b"PAR1")


def row_of_another_trial(directory: Path) -> None:
    path = directory / "throws.parquet"
    table = pq.read_table(path)
    pq.write_table(table.take([0, 1, 2, 3, 5, 5, 6]), path)


def rows_in_another_order(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).take([0, 1, 2, 4, 3, 5, 6]), path)


def a_row_too_many(directory: Path) -> None:
    change_table(directory / "throws.parquet", "trial", 6, 7)


def column_missing(directory: Path) -> None:
    path = directory / "throws.parquet"
    pq.write_table(pq.read_table(path).drop_columns(["hit_angle_rad"]), path)


def table_damaged(directory: Path) -> None:
    flip(directory / "throws.parquet", 60)


def plan_value(directory: Path) -> None:
    change_table(directory / "plan.parquet", "task.duration_s", 5, 1.0)


def plan_seed(directory: Path) -> None:
    change_table(directory / "plan.parquet", "seed", 5, 42)


def plan_trial_removed(directory: Path) -> None:
    path = directory / "plan.parquet"
    pq.write_table(pq.read_table(path).slice(0, 6), path)


def plan_damaged(directory: Path) -> None:
    flip(directory / "plan.parquet", 60)


def plan_gone(directory: Path) -> None:
    (directory / "plan.parquet").unlink()


def config_value(directory: Path) -> None:
    replace_text(directory / "config.yaml", "mass_kg: 0.045", "mass_kg: 0.05")


def config_height(directory: Path) -> None:
    """The recordings would be wrong by this configuration, but they are not."""
    replace_text(directory / "config.yaml", "base_height_m: 1.01927", "base_height_m: 1.1")


def bag_no_yaml(directory: Path) -> None:
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: [")


def bag_files(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "- quick_00001.mcap", "- quick_00009.mcap")


def bag_file_count(directory: Path) -> None:
    """In one of the entries, not in the sum."""
    text = (directory / "metadata.yaml").read_text()
    entry = text.index("path: quick_00001.mcap")
    place = text.index("message_count: ", entry) + len("message_count: ")
    (directory / "metadata.yaml").write_text(text[:place] + "9" + text[place:])


def bag_format(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "throwcollect.format: '1'", "throwcollect.format: '7'")


def bag_extra_key(directory: Path) -> None:
    replace_text(directory / "metadata.yaml", "  version: 9", "  version: 9\n  colour: red")


DEFECTS: dict[Callable[[Path], None], tuple[str, str, str]] = {
    chunk_contents: (SHARD, "trial 4", "cannot be decompressed|CRC differs"),
    chunk_crc: (SHARD, "trial 4", "CRC differs"),
    chunk_end_time: (SHARD, "trial 4", "times differ"),
    message_index: (SHARD, "trial 5", "message indexes"),
    records_hash: (SHARD, "trial 3", "SHA-256 of its records is"),
    stored_digest: (SHARD, "trial 3", "metadata at byte"),
    header_contact: (SHARD, "trial 3", "metadata at byte"),
    torn: (SHARD, "", "cut off|beyond the end"),
    missing_footer: (SHARD, "summary", "a footer is missing"),
    trailing_bytes: (SHARD, "", "its records have"),
    statistics: (SHARD, "byte", "statistics does not fit"),
    chunk_index: (SHARD, "byte", "chunk_index does not fit"),
    footer_crc: (SHARD, "byte", "footer does not fit"),
    data_crc: (SHARD, "byte", "CRC of the data section"),
    profile: (SHARD, "byte", "profile ros2"),
    channel_qos: (SHARD, "channels", "/ball/odometry"),
    schema_name: (SHARD, "schemas", "std_msgs/msg/String is another one"),
    bag_copy: (SHARD, "byte", "copy of the bag's metadata"),
    shard_gone: (SHARD, "", "cannot be read"),
    shards_swapped: (SHARD, "trial 0", "does not place here"),
    measured_landing: ("quick_00000.mcap", "trial 2", r"landing_x_m = 1\.25, the episode gives"),
    outcome: (SHARD, "trial 4", "outcome = 'timeout', the episode gives 'landed'"),
    row_digest: (SHARD, "trial 4", "digest = '000"),
    row_offset: (SHARD, "trial 4", "chunk_offset = 17"),
    row_lost: (SHARD, "trial 4", "does not place here"),
    row_invented: ("throws.parquet", "trial 4", "is lost with shard"),
    swept_value: ("throws.parquet", "trial 6", r"task\.duration_s = 0\.9, the plan"),
    refused_row: ("throws.parquet", "trial 6", "nothing against it"),
    row_missing: ("throws.parquet", "trial 6", "has no row"),
    plan_of_another: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    config_broken: ("config.yaml", "", "trials"),
    bag_count: ("metadata.yaml", "message_count", "the files give"),
    bag_digest: ("metadata.yaml", "throwcollect.digest", "the episodes give"),
    bag_qos: ("metadata.yaml", "topics_with_message_count", "the files give"),
    open_shard_left: ("quick_00003.mcap.part", "", "not written to its end"),
    card_gone: ("README.md", "", "is missing"),
    duplicate_episode: (SHARD, "trial 4", r"byte \d+: the file has an episode of this trial already, at byte \d+"),
    episodes_in_another_order: (SHARD, "trial 4", "comes after trial 5"),
    episode_missing: (SHARD, "trial 4", "the file has no whole one"),
    episode_of_another_shard: (SHARD, "trial 1", "does not place here"),
    episode_of_another_dataset: (SHARD, "trial 4", "throws.parquet has .* more columns differ"),
    altered_with_all_hashes_made_to_fit: (SHARD, "trial 4", "throws.parquet has digest"),
    schema_text: (SHARD, "schemas", "nav_msgs/msg/Odometry is another one"),
    schema_length: (SHARD, "byte", "beyond the end"),
    first_magic: (SHARD, "byte 0", "does not begin as an MCAP file does"),
    last_magic: (SHARD, "byte", "does not end as an MCAP file does"),
    latched_chunk: (SHARD, "byte", "latched topics: chunk: "),
    latched_index: (SHARD, "byte", "message indexes of the latched topics"),
    chunk_opcode: (SHARD, "byte", r"a record 0x16 where .*; the next episode is at byte \d+$"),
    chunk_length: (SHARD, "byte", r"the next episode is at byte \d+$"),
    index_length: (SHARD, "byte", r"the next episode is at byte \d+$"),
    metadata_name: (SHARD, "byte", "where the metadata of an episode should be"),
    metadata_length: (SHARD, "", "metadata record is not readable|metadata at byte .* do not fit"),
    header_json: (SHARD, "byte", "episode header: .* Invalid JSON"),
    zeroed_sector: (SHARD, "byte", "a record 0x00 where"),
    bytes_inserted: (SHARD, "byte", "beyond the end"),
    cut_in_the_header: (SHARD, "byte 8", "cut off"),
    cut_in_the_first_episode: (SHARD, "byte", "beyond the end"),
    cut_after_an_episode: (SHARD, "byte", "cut off"),
    emptied: (SHARD, "", "has 0 bytes"),
    a_directory_instead: (SHARD, "", "not a file"),
    summary_record_missing: (SHARD, "byte", "a metadata_index where a chunk_index should be"),
    extra_shard: ("quick_00003.mcap", "", "no row of throws"),
    new_file_left: ("throws.parquet.new", "", "not written to its end"),
    row_of_another_trial: ("throws.parquet", "trial 5", "more than one row"),
    rows_in_another_order: ("throws.parquet", "", "not in order of trials"),
    a_row_too_many: ("throws.parquet", "trial 7", "not one of the plan"),
    column_missing: ("throws.parquet", "", "hit_angle_rad"),
    table_damaged: ("throws.parquet", "", "is damaged"),
    plan_value: ("plan.parquet", "trial 5", "its values and seed give"),
    plan_seed: ("plan.parquet", "trial 5", "its values and seed give"),
    plan_trial_removed: ("throws.parquet", "trial 6", "not one of the plan"),
    plan_damaged: ("plan.parquet", "", "is damaged"),
    plan_gone: ("plan.parquet", "", "is missing"),
    config_value: ("config.yaml", "", "not the configuration that plan.parquet was made for"),
    config_height: ("config.yaml", "", "one of the two was changed"),
    bag_no_yaml: ("metadata.yaml", "", "cannot be read"),
    bag_files: ("metadata.yaml", "relative_file_paths", "the files give"),
    bag_file_count: ("metadata.yaml", "files", "the files give"),
    bag_format: ("metadata.yaml", "throwcollect.format", "is '7'"),
    bag_extra_key: ("metadata.yaml", "", "unknown keys: .*colour"),
}

CONSEQUENCES: dict[Callable[[Path], None], tuple[str, ...]] = {
    records_hash: ("metadata.yaml",),
    header_contact: ("metadata.yaml",),
    row_lost: ("metadata.yaml",),
    duplicate_episode: ("metadata.yaml",),
    episode_missing: ("metadata.yaml",),
    episode_of_another_shard: ("metadata.yaml",),
    episode_of_another_dataset: ("metadata.yaml",),
    altered_with_all_hashes_made_to_fit: ("metadata.yaml",),
    shards_swapped: ("quick_00000.mcap", "metadata.yaml"),
    row_invented: (SHARD,),
    refused_row: ("quick_00002.mcap",),
    a_row_too_many: ("quick_00002.mcap",),
    plan_trial_removed: ("quick_00002.mcap", "plan.parquet"),
}
"""Other files that a defect contradicts."""


def test_a_sound_dataset_has_no_findings(dataset: Path) -> None:
    assert verify(dataset) == []


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
    assert json.loads(json.dumps([finding.as_dict() for finding in findings]))


def test_what_is_sound_beside_a_defect_is_not_accused(dataset: Path) -> None:
    measured_landing(dataset)
    fit_manifest(dataset)
    (finding,) = verify(dataset)
    assert str(finding).startswith("quick_00000.mcap: trial 2: throws.parquet has landing_x_m = 1.25")


def test_a_damaged_table_does_not_keep_the_rest_from_being_checked(dataset: Path) -> None:
    for plant in (chunk_contents, zeroed_sector, bag_no_yaml, table_damaged, plan_seed, card_gone):
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
    config_broken(dataset)
    plan_damaged(dataset)
    chunk_contents(dataset)
    found = {(finding.file, finding.place) for finding in verify(dataset)}
    assert ("config.yaml", "line 1") in found
    assert (SHARD, "trial 4") in found
    assert not any(file in ("quick_00000.mcap", "quick_00002.mcap", "metadata.yaml") for file, _ in found)


def test_a_damaged_stretch_is_told_with_its_end_and_hides_nothing_behind_it(dataset: Path) -> None:
    zeroed_sector(dataset)
    second, third = (pq.read_table(dataset / "throws.parquet")["chunk_offset"].to_pylist()[trial] for trial in (4, 5))
    flip(dataset / SHARD, third + 2000)
    fit_manifest(dataset)
    findings = verify(dataset)
    assert [finding.place for finding in findings] == [f"byte {second}", "trial 5", "trial 4"]
    assert findings[0].problem.endswith(f"the next episode is at byte {third}")


def test_a_changed_sample_is_found_even_if_all_checksums_are_made_to_fit(dataset: Path) -> None:
    """Somebody rewrites one number of a chunk, its CRC and its size: the hash still says so."""
    path = dataset / SHARD
    episode = stored(path, 4)
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


def kicked(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """In the middle of the flight the ball gains a micrometre per second, and nothing touches it."""
    if header.trial != 2:
        return samples, header
    half = (len(samples) + 100) // 2
    seconds = np.maximum(0, np.arange(len(samples)) - half) / 250
    position = samples.ball_position + 1e-6 * seconds[:, np.newaxis] * np.array([1.0, 0, 0])
    return replace(samples, ball_position=position), header


def stalled(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """One sample is missing."""
    if header.trial != 2:
        return samples, header
    kept = np.delete(np.arange(len(samples)), 40)
    return Samples(**{name: column[kept] for name, column in vars(samples).items()}), replace(header, samples=len(kept))


def late(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The trial ran in another slot of time; its contacts with it."""
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
        (kicked, "departs from ballistic motion by"),
        (stalled, "not spaced by 1/250 s"),
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
    """A shard recorded with another height of the base: only its static transforms tell."""
    other = make_collection({"robot": {"base_height_m": 1.1}}).collect(tmp_path / "other")
    (dataset / SHARD).write_bytes((other / SHARD).read_bytes())
    assert any("/tf_static does not fit" in str(finding) for finding in verify(dataset))


def test_a_file_cut_anywhere_is_reported_and_never_raises(dataset: Path) -> None:
    whole = (dataset / "quick_00002.mcap").read_bytes()
    for size in (0, 8, 17, 40, 5000, len(whole) // 2, len(whole) - 30, len(whole) - 1):
        (dataset / "quick_00002.mcap").write_bytes(whole[:size])
        assert any(finding.file == "quick_00002.mcap" for finding in verify(dataset)), size


def test_random_damage_is_always_found_and_never_raises(make_collection: Any, tmp_path: Path) -> None:
    path = make_collection({"trials": 1}).collect(tmp_path / "dataset") / "quick_00000.mcap"
    whole = path.read_bytes()
    random = np.random.default_rng(0)
    for offset in random.integers(8, len(whole), size=20).tolist():
        flip(path, offset, bit=1 << int(random.integers(8)))
        assert any(finding.file == path.name for finding in verify(path.parent)), offset
        path.write_bytes(whole)


def test_huge_announced_sizes_are_refused_without_being_believed(dataset: Path) -> None:
    path = dataset / SHARD
    chunk = stored(path, 4).chunks[0].record
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, chunk.offset + 9 + 16, 1 << 62)
    path.write_bytes(data)
    assert any("as announced" in str(finding) for finding in verify(dataset))


def test_only_a_finished_dataset_is_verified(collection: Any, tmp_path: Path) -> None:
    create(tmp_path / "dataset", collection.plan)
    with pytest.raises(DatasetError, match="is not finished"):
        verify(tmp_path / "dataset")
