"""Every record of a recording follows the MCAP specification, as checked with code of other packages."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from tests.unit.dataset.mcap_doctor import MAGIC, Examination, place_records

ALL_TOPICS = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]


@pytest.fixture(scope="module")
def shard(collected: Path) -> Path:
    return collected / "quick_00002.mcap"


def test_every_record_of_every_recording_is_sound(collected: Path) -> None:
    examined = [Examination(path) for path in sorted(collected.glob("*.mcap"))]
    assert [len(each.chunk_indexes) for each in examined] == [4, 4, 2]


def test_every_record_is_sound_when_all_topics_are_recorded(make_collection: Any, tmp_path: Path) -> None:
    settings = {"trials": 1, "record": {"topics": ALL_TOPICS}}
    make_collection(settings).collect(tmp_path / "full")
    examined = Examination(tmp_path / "full" / "quick_00000.mcap")
    assert sorted(examined.counts) == sorted(examined.channels)
    assert len(examined.channels) == 8


def change(opcode: Opcode, offset: int, *, mend: bool = False) -> Callable[[bytearray], None]:
    """Flip a bit in the last record of a kind, and make the CRC of the data fit again if asked."""

    def spoil(data: bytearray) -> None:
        end = len(data) - len(MAGIC)
        every = list(place_records(bytes(data), len(MAGIC), end))
        record = [record for record in every if record.opcode == opcode][-1]
        data[record.offset + 9 + offset] ^= 1
        if mend:
            (border,) = [record for record in every if record.opcode == Opcode.DATA_END]
            struct.pack_into("<I", data, border.offset + 9, zlib.crc32(data[: border.offset]))

    return spoil


@pytest.mark.parametrize(
    "spoil",
    [
        pytest.param(change(Opcode.HEADER, 4), id="data CRC"),
        pytest.param(change(Opcode.CHUNK, 0, mend=True), id="start time of a chunk"),
        pytest.param(change(Opcode.CHUNK, 24, mend=True), id="CRC of a chunk"),
        pytest.param(change(Opcode.MESSAGE_INDEX, 6, mend=True), id="message index"),
        pytest.param(change(Opcode.METADATA, 4, mend=True), id="name of metadata"),
        pytest.param(change(Opcode.CHUNK_INDEX, 0), id="chunk index"),
        pytest.param(change(Opcode.STATISTICS, 0), id="statistics"),
        pytest.param(change(Opcode.SUMMARY_OFFSET, 1), id="summary offset"),
        pytest.param(change(Opcode.FOOTER, 16), id="summary CRC"),
    ],
)
def test_the_examination_finds_a_single_flipped_bit(
    shard: Path, tmp_path: Path, spoil: Callable[[bytearray], None]
) -> None:
    data = bytearray(shard.read_bytes())
    spoil(data)
    spoiled = tmp_path / "spoiled.mcap"
    spoiled.write_bytes(data)
    with pytest.raises(AssertionError):
        Examination(spoiled)
