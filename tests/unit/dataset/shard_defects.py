"""Defects of a shard that tests plant, and the finding that each must give."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import zstandard
from mcap.opcode import Opcode
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import SHARD, find_stored, flip, record_of

from throwcollect.config.loader import load
from throwcollect.dataset.mcap_file import McapFile, episode_run
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.recorded_chunk import RecordedChunk
from throwcollect.episode.topics import joint_states
from throwcollect.robots.description import full_description
from throwcollect.robots.talos import TALOS


def damage_chunk_contents(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset + 2000)


def damage_chunk_crc(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset + 9 + 24)


def change_chunk_end_time(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset + 9 + 8)


def damage_message_index(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 5).chunks[0].indexes[4].offset + 200)


def change_stored_digest(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 3).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b"digest") + 12)


def change_records_hash(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 3).facts
    place = facts.offset + facts.data.index(b"records_sha256") + len(b"records_sha256") + 4
    data = bytearray((directory / SHARD).read_bytes())
    data[place] = ord("0") if data[place] != ord("0") else ord("1")
    (directory / SHARD).write_bytes(data)


def change_header_contact(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 3).facts
    # The contact ends 1 ns later: valid, but not what was hashed.
    flip(directory / SHARD, facts.offset + facts.data.index(b'"end_ns":64400000000') + len('"end_ns":64400000000') - 1)


def tear_file(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data[: len(data) * 2 // 3])


def cut_footer(directory: Path) -> None:
    footer = record_of(directory / SHARD, Opcode.FOOTER)
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[: footer.offset])


def append_bytes(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    (directory / SHARD).write_bytes(data + data[-8:])


def change_statistics(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.STATISTICS).offset + 9)


def change_chunk_index(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.CHUNK_INDEX, last=True).offset + 9 + 16)


def change_footer_crc(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.FOOTER).offset + 9 + 16)


def change_data_crc(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.DATA_END).offset + 9)


def change_profile(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.HEADER).offset + 9 + 4)


def change_channel_qos(directory: Path) -> None:
    channel = record_of(directory / SHARD, Opcode.CHANNEL, holding=b"/ball/odometry")
    flip(directory / SHARD, channel.offset + channel.data.index(b"depth: 10") + 8)


def change_schema_name(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA)
    flip(directory / SHARD, schema.offset + 9 + 2 + 4, bit=0x20)


def change_bag_copy(directory: Path) -> None:
    copy = record_of(directory / SHARD, Opcode.METADATA, holding=b"serialized_metadata")
    flip(directory / SHARD, copy.offset + copy.data.index(b"version: 9") + 9)


def delete_shard(directory: Path) -> None:
    (directory / SHARD).unlink()


def swap_shards(directory: Path) -> None:
    one, other = (directory / "quick_00000.mcap").read_bytes(), (directory / SHARD).read_bytes()
    (directory / "quick_00000.mcap").write_bytes(other)
    (directory / SHARD).write_bytes(one)


def leave_open_shard(directory: Path) -> None:
    (directory / "quick_00003.mcap.part").write_bytes(b"")


def write_shard(path: Path, episodes: list[Episode]) -> None:
    """Write a sound shard of these episodes."""
    config = load(path.parent / "config.yaml")
    with path.open("wb") as file:
        mcap = McapFile(file.write, Channels(config, full_description(config)), start_ns=episodes[0].chunk.start_ns)
        for episode in episodes:
            mcap.append(episode_run(episode))
        mcap.finish(path.name)


def read_episodes(directory: Path) -> list[Episode]:
    return [find_stored(directory / SHARD, trial).episode for trial in (3, 4, 5)]


def repeat_episode(directory: Path) -> None:
    first, second, third = read_episodes(directory)
    write_shard(directory / SHARD, [first, second, second, third])


def reorder_episodes(directory: Path) -> None:
    first, second, third = read_episodes(directory)
    write_shard(directory / SHARD, [first, third, second])


def leave_out_episode(directory: Path) -> None:
    first, _, third = read_episodes(directory)
    write_shard(directory / SHARD, [first, third])


def take_episode_of_another_shard(directory: Path) -> None:
    first, second, _ = read_episodes(directory)
    write_shard(directory / SHARD, [first, second, find_stored(directory / "quick_00000.mcap", 1).episode])


def take_episode_of_another_dataset(directory: Path) -> None:
    first, second, third = read_episodes(directory)
    other = Collection({"ball": {"mass_kg": 0.1}, "seed": 1}).episode(4)
    assert other.digest != second.digest
    write_shard(directory / SHARD, [first, other, third])


def change_sample_and_all_hashes(directory: Path) -> None:
    first, second, third = read_episodes(directory)
    contents = bytearray(second.chunk.decompress())
    contents[31 + joint_states(TALOS.joints).layout.dtype.fields["position"][1] + 6] ^= 1
    data = zstandard.ZstdCompressor(level=1).compress(bytes(contents))
    chunk = replace(second.chunk, data=data, crc=zlib.crc32(contents))
    write_shard(
        directory / SHARD,
        [first, Episode(second.header, RecordedChunk(chunk, hashlib.sha256(contents).hexdigest())), third],
    )


def change_schema_text(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA, holding=b"nav_msgs/msg/Odometry")
    flip(directory / SHARD, schema.end - 40)


def change_schema_length(directory: Path) -> None:
    schema = record_of(directory / SHARD, Opcode.SCHEMA, holding=b"nav_msgs/msg/Odometry")
    flip(directory / SHARD, schema.offset + 2)


def change_first_magic(directory: Path) -> None:
    flip(directory / SHARD, 3)


def change_last_magic(directory: Path) -> None:
    flip(directory / SHARD, (directory / SHARD).stat().st_size - 3)


def damage_latched_chunk(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.CHUNK).end - 500)


def damage_latched_index(directory: Path) -> None:
    flip(directory / SHARD, record_of(directory / SHARD, Opcode.MESSAGE_INDEX).offset + 15)


def change_chunk_opcode(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset, bit=0x10)


def change_chunk_length(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).offset + 2)


def change_index_length(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).chunks[0].indexes[4].offset + 2)


def change_metadata_name(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 4).facts.offset + 9 + 4)


def change_metadata_length(directory: Path) -> None:
    flip(directory / SHARD, find_stored(directory / SHARD, 5).facts.offset + 1)


def damage_header_json(directory: Path) -> None:
    facts = find_stored(directory / SHARD, 4).facts
    flip(directory / SHARD, facts.offset + facts.data.index(b'{"trial"'))


def zero_sector(directory: Path) -> None:
    data = bytearray((directory / SHARD).read_bytes())
    start = find_stored(directory / SHARD, 4).chunks[0].indexes[3].offset - 100
    data[start : start + 512] = bytes(512)
    (directory / SHARD).write_bytes(data)


def insert_bytes(directory: Path) -> None:
    data = (directory / SHARD).read_bytes()
    place = find_stored(directory / SHARD, 4).facts.end
    (directory / SHARD).write_bytes(data[:place] + b"between" + data[place:])


def cut_in_the_header(directory: Path) -> None:
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[:12])


def cut_in_the_first_episode(directory: Path) -> None:
    end = find_stored(directory / SHARD, 3).chunks[0].record.end
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[: end - 100])


def cut_after_an_episode(directory: Path) -> None:
    end = find_stored(directory / SHARD, 4).facts.end
    (directory / SHARD).write_bytes((directory / SHARD).read_bytes()[:end])


def empty_shard(directory: Path) -> None:
    (directory / SHARD).write_bytes(b"")


def replace_by_directory(directory: Path) -> None:
    (directory / SHARD).unlink()
    (directory / SHARD).mkdir()


def leave_out_summary_record(directory: Path) -> None:
    path = directory / SHARD
    index = record_of(path, Opcode.CHUNK_INDEX, last=True)
    data = path.read_bytes()
    path.write_bytes(data[: index.offset] + data[index.end :])


def add_shard(directory: Path) -> None:
    (directory / "quick_00003.mcap").write_bytes((directory / SHARD).read_bytes())


SHARD_DEFECTS: dict[Callable[[Path], None], tuple[str, str, str]] = {
    damage_chunk_contents: (SHARD, "trial 4", "cannot be decompressed|CRC differs"),
    damage_chunk_crc: (SHARD, "trial 4", "CRC differs"),
    change_chunk_end_time: (SHARD, "trial 4", "times differ"),
    damage_message_index: (SHARD, "trial 5", "message indexes"),
    change_records_hash: (SHARD, "trial 3", "SHA-256 of its records is"),
    change_stored_digest: (SHARD, "trial 3", "metadata at byte"),
    change_header_contact: (SHARD, "trial 3", "metadata at byte"),
    tear_file: (SHARD, "", "cut off|beyond the end"),
    cut_footer: (SHARD, "summary", "a footer is missing"),
    append_bytes: (SHARD, "", "its records have"),
    change_statistics: (SHARD, "byte", "statistics does not fit"),
    change_chunk_index: (SHARD, "byte", "chunk_index does not fit"),
    change_footer_crc: (SHARD, "byte", "footer does not fit"),
    change_data_crc: (SHARD, "byte", "CRC of the data section"),
    change_profile: (SHARD, "byte", "profile ros2"),
    change_channel_qos: (SHARD, "channels", "/ball/odometry"),
    change_schema_name: (SHARD, "schemas", "std_msgs/msg/String is another one"),
    change_bag_copy: (SHARD, "byte", "copy of the bag's metadata"),
    delete_shard: (SHARD, "", "cannot be read"),
    swap_shards: (SHARD, "trial 0", "does not place here"),
    leave_open_shard: ("quick_00003.mcap.part", "", "not written to its end"),
    repeat_episode: (SHARD, "trial 4", r"byte \d+: the file has an episode of this trial already, at byte \d+"),
    reorder_episodes: (SHARD, "trial 4", "comes after trial 5"),
    leave_out_episode: (SHARD, "trial 4", "the file has no whole one"),
    take_episode_of_another_shard: (SHARD, "trial 1", "does not place here"),
    take_episode_of_another_dataset: (SHARD, "trial 4", "throws.parquet has .* more columns differ"),
    change_sample_and_all_hashes: (SHARD, "trial 4", "throws.parquet has digest"),
    change_schema_text: (SHARD, "schemas", "nav_msgs/msg/Odometry is another one"),
    change_schema_length: (SHARD, "byte", "beyond the end"),
    change_first_magic: (SHARD, "byte 0", "does not begin as an MCAP file does"),
    change_last_magic: (SHARD, "byte", "does not end as an MCAP file does"),
    damage_latched_chunk: (SHARD, "byte", "latched topics: chunk: "),
    damage_latched_index: (SHARD, "byte", "message indexes of the latched topics"),
    change_chunk_opcode: (SHARD, "byte", r"a record 0x16 where .*; the next episode is at byte \d+$"),
    change_chunk_length: (SHARD, "byte", r"the next episode is at byte \d+$"),
    change_index_length: (SHARD, "byte", r"the next episode is at byte \d+$"),
    change_metadata_name: (SHARD, "byte", "where the metadata of an episode should be"),
    change_metadata_length: (SHARD, "", "metadata record is not readable|metadata at byte .* do not fit"),
    damage_header_json: (SHARD, "byte", "episode header: .* Invalid JSON"),
    zero_sector: (SHARD, "byte", "a record 0x00 where"),
    insert_bytes: (SHARD, "byte", "beyond the end"),
    cut_in_the_header: (SHARD, "byte 8", "cut off"),
    cut_in_the_first_episode: (SHARD, "byte", "beyond the end"),
    cut_after_an_episode: (SHARD, "byte", "cut off"),
    empty_shard: (SHARD, "", "has 0 bytes"),
    replace_by_directory: (SHARD, "", "not a file"),
    leave_out_summary_record: (SHARD, "byte", "a metadata_index where a chunk_index should be"),
    add_shard: ("quick_00003.mcap", "", "no row of throws"),
}
"""File, place and problem of the finding that each defect must give."""


SHARD_CONSEQUENCES: dict[Callable[[Path], None], tuple[str, ...]] = {
    change_records_hash: ("metadata.yaml",),
    change_header_contact: ("metadata.yaml",),
    repeat_episode: ("metadata.yaml",),
    leave_out_episode: ("metadata.yaml",),
    take_episode_of_another_shard: ("metadata.yaml",),
    take_episode_of_another_dataset: ("metadata.yaml",),
    change_sample_and_all_hashes: ("metadata.yaml",),
    swap_shards: ("quick_00000.mcap", "metadata.yaml"),
}
"""Other files in which a defect gives findings too."""
