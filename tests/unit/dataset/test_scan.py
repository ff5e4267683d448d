"""A scan finds the whole episodes in files that are damaged elsewhere."""

from __future__ import annotations

import os
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.unit.dataset.mutations import Mutation, any_mutation, mutate

from throwcollect.dataset.mcap_reader import WholeEpisode, open_mcap, scan_file
from throwcollect.episode.chunk import Chunk

SHARD = "quick_00001.mcap"


@pytest.fixture(scope="module")
def whole(collected: Path) -> bytes:
    return (collected / SHARD).read_bytes()


@pytest.fixture(scope="module")
def found(collected: Path) -> list[WholeEpisode]:
    """The three episodes of an undamaged file."""
    return list(scan_file(collected / SHARD))


def find_in(path: Path, data: bytes) -> list[int]:
    path.write_bytes(data)
    return [each.episode.header.trial for each in scan_file(path)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "damaged.mcap.part"


def test_a_scan_finds_all_episodes_of_a_sound_recording_where_they_lie(
    collected: Path, found: list[WholeEpisode]
) -> None:
    assert [each.episode.header.trial for each in found] == [3, 4, 5]
    assert [each.run.offset for each in found[1:]] == [each.run.end for each in found[:-1]]
    with open_mcap(collected / SHARD) as contents:
        for each in found:
            episode, end = contents.episode(each.run.offset)
            assert (episode.chunk, episode.header, end) == (each.episode.chunk, each.episode.header, each.run.end)


@settings(deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(wrong=st.integers(0, 2), mutation=any_mutation)
def test_damage_of_one_episode_loses_no_other_one(
    path: Path, whole: bytes, found: list[WholeEpisode], wrong: int, mutation: Mutation
) -> None:
    start, end = found[wrong].run.offset, found[wrong].run.end
    damaged = mutate(whole[start:end], [mutation])
    trials = find_in(path, whole[:start] + damaged + whole[end:])
    assert trials == [3, 4, 5] or (damaged != whole[start:end] and trials == [n for n in (3, 4, 5) if n != 3 + wrong])


def test_a_recording_cut_anywhere_has_the_episodes_before_the_cut(
    path: Path, whole: bytes, found: list[WholeEpisode]
) -> None:
    ends = [each.run.end for each in found]
    cuts = {0, 3, *range(100, len(whole), 9973), *ends, *(end - 1 for end in ends)}
    for size in sorted(cuts):
        assert len(find_in(path, whole[:size])) == sum(end <= size for end in ends), size


def test_a_file_of_noise_has_no_episode(path: Path) -> None:
    assert find_in(path, np.random.default_rng(0).bytes(100_000)) == []
    assert find_in(path, b"") == []


@pytest.mark.parametrize("behind", ["", "message indexes"])
def test_a_scan_of_nested_chunks_gives_up_before_it_takes_quadratic_time(
    path: Path, monkeypatch: pytest.MonkeyPatch, behind: str
) -> None:
    """Each header begins a chunk that reaches to the end of all headers, and perhaps to many empty records."""
    size, count = len(Chunk(b"", 0, 0, 0, 0).record()), 3000
    headers = [Chunk(bytes(size * each), 0, 0, 0, 0).record()[:size] for each in reversed(range(count))]
    parse, parsed = Chunk.parse, []
    monkeypatch.setattr(Chunk, "parse", lambda record: parsed.append(len(record)) or parse(record))
    indexes = b"\x07" + bytes(8)
    assert find_in(path, b"".join(headers) + indexes * 5_000 * bool(behind)) == []
    assert 60 <= len(parsed) <= 200


def test_a_file_of_holes_is_read_up_to_twice_its_data(path: Path, whole: bytes) -> None:
    assert find_in(path, whole) == [3, 4, 5]
    os.truncate(path, 1 << 40)
    with open_mcap(path) as contents:
        assert len(whole) < len(contents) < 3 * len(whole)
    assert [each.episode.header.trial for each in scan_file(path)] == [3, 4, 5]


def test_an_episode_with_changed_samples_and_a_fitting_crc_is_not_found(
    path: Path, whole: bytes, found: list[WholeEpisode]
) -> None:
    episode, run = found[1]
    contents = bytearray(episode.chunk.decompress())
    contents[200] ^= 1
    data = zstandard.ZstdCompressor(level=1).compress(bytes(contents))
    chunk = replace(episode.chunk, data=data, crc=zlib.crc32(contents)).record()
    behind = run.offset + episode.chunk.record_size
    assert find_in(path, whole[: run.offset] + chunk + whole[behind:]) == [3, 5]
