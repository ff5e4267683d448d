"""Helpers that damage a file of a dataset: one bit, one value, one line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from mcap.opcode import Opcode

from throwcollect.dataset.mcap_file import MAGIC
from throwcollect.dataset.mcap_reader import McapContents, McapRecord, WholeEpisode, open_mcap

SHARD = "quick_00001.mcap"


def find_stored(path: Path, trial: int) -> WholeEpisode:
    offset = pq.read_table(path.parent / "throws.parquet")["chunk_offset"].to_pylist()[trial]
    with open_mcap(path) as contents:
        return contents.whole_episode(offset)


def find_facts(path: Path, trial: int, text: bytes) -> int:
    """Where a text of the metadata of an episode begins in its file."""
    run = find_stored(path, trial).run
    return path.read_bytes().index(text, run.end - run.metadata_length)


def records_of(contents: McapContents) -> Iterator[McapRecord]:
    """The records of a file, to the footer or its end."""
    offset = len(MAGIC)
    while offset < len(contents):
        yield (record := contents.record(offset))
        if record.opcode == Opcode.FOOTER:
            return
        offset = record.end


def record_of(path: Path, opcode: Opcode) -> McapRecord:
    """The first record of a kind."""
    with open_mcap(path) as contents:
        return next(each for each in records_of(contents) if each.opcode == opcode)


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
