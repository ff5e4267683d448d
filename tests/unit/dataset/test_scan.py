"""A scan finds whole episodes in files that are damaged elsewhere."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard

from throwcollect.dataset.mcap_file import MAGIC
from throwcollect.dataset.mcap_reader import StoredEpisode, open_mcap, scan_file
from throwcollect.episode.chunk import Chunk
from throwcollect.errors import DatasetError

SHARD = "quick_00001.mcap"


@pytest.fixture(scope="module")
def whole(collected: Path) -> bytes:
    return (collected / SHARD).read_bytes()


@pytest.fixture(scope="module")
def runs(collected: Path) -> list[StoredEpisode]:
    """The three episodes of an undamaged file."""
    return list(scan_file(collected / SHARD))


def find_in(path: Path, data: bytes) -> list[tuple[int, bool]]:
    path.write_bytes(data)
    return [(found.episode.header.trial, found.run is not None) for found in scan_file(path)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "damaged.mcap.part"


def test_a_scan_finds_all_episodes_of_a_sound_recording_at_their_offsets(
    collected: Path, runs: list[StoredEpisode]
) -> None:
    assert [(each.episode.header.trial, each.run is not None) for each in runs] == [(3, True), (4, True), (5, True)]
    assert [each.offset for each in runs[1:]] == [each.end for each in runs[:-1]]
    with open_mcap(collected / SHARD) as contents:
        for each in runs:
            stored = contents.episode(contents.record(each.offset))
            assert (stored.chunk, stored.indexes, stored.facts) == (each.chunk, each.indexes, each.facts)


@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_a_damaged_chunk_loses_only_its_own_episode(
    path: Path, whole: bytes, runs: list[StoredEpisode], wrong: int
) -> None:
    data = bytearray(whole)
    data[runs[wrong].offset + 3000] ^= 1
    assert find_in(path, bytes(data)) == [(trial, True) for trial in (3, 4, 5) if trial != 3 + wrong]


def test_a_wrong_length_of_a_chunk_loses_only_its_episode(path: Path, whole: bytes, runs: list[StoredEpisode]) -> None:
    for length in (0, 1, 2**32 - 1, 2**63, 2**64 - 1):
        data = bytearray(whole)
        struct.pack_into("<Q", data, runs[1].offset + 1, length)
        assert find_in(path, bytes(data)) == [(3, True), (5, True)]


def test_a_missing_or_inserted_stretch_hides_no_later_episode(
    path: Path, whole: bytes, runs: list[StoredEpisode]
) -> None:
    place = runs[1].offset + 5000
    assert find_in(path, whole[:place] + whole[place + 512 :]) == [(3, True), (5, True)]
    assert find_in(path, whole[:place] + bytes(512) + whole[place:]) == [(3, True), (5, True)]
    # So many bytes are missing that the length of the chunk leads into the next one.
    assert find_in(path, whole[:place] + whole[place + 20_000 :]) == [(3, True), (5, True)]
    assert find_in(path, whole[len(MAGIC) + 1000 :]) == [(3, True), (4, True), (5, True)]
    # The end of an episode and the start of the next one are missing.
    assert find_in(path, whole[: runs[1].end - 50] + whole[runs[2].offset + 50 :]) == [(3, True)]


def test_an_episode_with_damaged_indexes_is_found_but_not_intact(
    path: Path, whole: bytes, runs: list[StoredEpisode]
) -> None:
    begin = runs[1].chunk.end
    for place in (begin, begin + 1, runs[1].facts.offset - 300):
        data = bytearray(whole)
        data[place] ^= 0x40
        assert find_in(path, bytes(data)) == [(3, True), (4, False), (5, True)]


def test_an_episode_with_a_changed_header_is_not_found(path: Path, whole: bytes, runs: list[StoredEpisode]) -> None:
    facts = runs[1].facts
    place = facts.offset + facts.data.index(b"landed")
    assert find_in(path, whole[:place] + b"rested" + whole[place + 6 :]) == [(3, True), (5, True)]


def test_a_recording_cut_anywhere_has_the_episodes_before_the_cut(
    path: Path, whole: bytes, runs: list[StoredEpisode]
) -> None:
    ends = [run.end for run in runs]
    cuts = {0, 3, *range(100, len(whole), 9973), *ends, *(end - 1 for end in ends)}
    for size in sorted(cuts):
        assert len(find_in(path, whole[:size])) == sum(end <= size for end in ends), size


def test_a_file_of_noise_has_no_episode(path: Path) -> None:
    assert find_in(path, np.random.default_rng(0).bytes(100_000)) == []
    assert find_in(path, b"") == []


def test_a_chunk_that_announces_too_much_is_not_decompressed(path: Path, runs: list[StoredEpisode]) -> None:
    """Zeros compress so well that a small file could fill the memory."""
    zeros = zstandard.ZstdCompressor(level=1).compress(bytes(50_000_000))
    bomb = Chunk(zeros, 50_000_000, 0, 0, 0)
    with pytest.raises(DatasetError, match="bytes of data announce 50000000"):
        bomb.decompress()
    assert find_in(path, bomb.record() + runs[0].facts.data) == []


def test_a_scan_of_nested_chunks_gives_up_after_64_times_the_file_size(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each header begins a chunk that reaches to the end of the file; the scan stops after 64 times its size."""
    header = Chunk(b"", 0, 0, 0, 0).record()
    count = 3000
    data = bytearray()
    for number in range(count):
        behind = len(header) * (count - number - 1)
        data += Chunk(bytes(behind), 0, 0, 0, 0).record()[: len(header)]
    parse, parsed = Chunk.parse, []
    monkeypatch.setattr(Chunk, "parse", lambda record: parsed.append(len(record)) or parse(record))
    assert find_in(path, bytes(data)) == []
    assert 60 <= len(parsed) <= 70


def test_an_episode_with_changed_samples_and_a_fitting_crc_is_not_found(
    path: Path, whole: bytes, runs: list[StoredEpisode]
) -> None:
    stored = runs[1]
    contents = bytearray(stored.episode.chunk.decompress())
    contents[200] ^= 1
    data = zstandard.ZstdCompressor(level=1).compress(bytes(contents))
    chunk = replace(stored.episode.chunk, data=data, crc=zlib.crc32(contents)).record()
    assert find_in(path, whole[: stored.offset] + chunk + whole[stored.chunk.end :]) == [
        (3, True),
        (5, True),
    ]


def test_a_scan_of_a_directory_is_an_error_and_a_missing_file_has_no_episodes(tmp_path: Path) -> None:
    assert not list(scan_file(tmp_path / "missing.mcap"))
    with pytest.raises(DatasetError, match="cannot be read: not a file"):
        list(scan_file(tmp_path))
