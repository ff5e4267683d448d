"""Keeps rows of the table of throws on disk until it is written, as a million rows fill half a gigabyte of memory."""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.throws_table import Row
from throwcollect.files import unwritable, write_all
from throwcollect.sweep.arrow_column import read_numbers, read_validity

_ALIGNED_BYTES = 64
"""Buffers of Arrow begin at multiples of this."""

_SHARDS_AT_ONCE = 50
"""Number of shards that are read before their memory is freed: the kernel also maps the bytes around each value."""

_Place = tuple[int, int]
"""First byte and number of bytes."""


class _NamelessFile:
    """A file without a name, which the system removes however this process ends; it is on the disk of `directory`."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / THROWS
        self._file: BinaryIO | None = None
        self._size = 0
        self._map: mmap.mmap | None = None

    def append(self, parts: Iterable[pa.Buffer]) -> _Place:
        """Append the bytes of some parts, each right behind the one before."""
        first = self._size
        for part in parts:
            self._write(part)
        place = first, self._size - first
        self._write(bytes(-self._size % _ALIGNED_BYTES))
        return place

    def _write(self, data: pa.Buffer | bytes) -> None:
        try:
            if self._file is None:
                # It lies beside the dataset, as the directory for temporary files may be in memory.
                self._file = tempfile.TemporaryFile(dir=self._path.parent, buffering=0)  # noqa: SIM115
            write_all(self._file.fileno(), data)
        except OSError as error:
            raise unwritable(self._path, error) from error
        self._size += len(data)

    def map(self) -> None:
        """Map all bytes that were appended so far, so that they can be read."""
        if self._file is not None:
            self._map = mmap.mmap(self._file.fileno(), self._size, prot=mmap.PROT_READ)

    def read(self, place: _Place) -> pa.Buffer:
        """Return the appended bytes of a place; the system reads them from the disk when they are looked at."""
        return pa.py_buffer(self._map).slice(*place)

    def let_go(self) -> None:
        """Free the memory of what was read; the system reads it again when it is looked at again."""
        if self._map is not None:
            self._map.madvise(mmap.MADV_DONTNEED)

    def close(self) -> None:
        """Close the file; what was read stays readable."""
        if self._file is not None:
            self._file.close()


class RowStore:
    """Rows of the shards of a dataset, which come in any order and are read in order of trials."""

    def __init__(self, directory: Path, schema: pa.Schema) -> None:
        self._schema = schema
        self._by_shards = _NamelessFile(directory)
        self._by_columns = _NamelessFile(directory)
        self._places: dict[int, _Place] = {}

    def put(self, number: int, rows: pa.Table) -> None:
        """Store the rows of a shard, in order of trials, under its number; `table` must not have been read yet."""
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, self._schema) as stream:
            stream.write_table(rows)
        self._places[number] = self._by_shards.append([sink.getvalue()])

    @cached_property
    def table(self) -> pa.Table:
        """All rows in order of trials, each column in one piece; values come from the disk when they are looked at."""
        self._by_shards.map()
        places = [place for _, place in sorted(self._places.items())]
        rows = pa.concat_tables([self._read(place) for place in places])
        columns = [self._put_column(column.chunks) for column in rows.columns]
        self._by_columns.map()
        pairs = zip(self._schema.types, columns, strict=True)
        arrays = [self._read_column(kind, len(rows), places) for kind, places in pairs]
        return pa.Table.from_arrays(arrays, schema=self._schema)

    def _read(self, place: _Place) -> pa.Table:
        return pa.ipc.open_stream(self._by_shards.read(place)).read_all()

    def _put_column(self, chunks: list[pa.Array]) -> tuple[_Place | None, ...]:
        """Write a column in one piece; returns the places of the buffers of its array, in the order of Arrow."""
        valid: list[NDArray[np.bool_]] = []
        ends = [np.zeros(1, np.int32)]

        def values() -> Iterator[pa.Buffer]:
            for first in range(0, len(chunks), _SHARDS_AT_ONCE):
                some = pa.concat_arrays(chunks[first : first + _SHARDS_AT_ONCE])
                valid.append(read_validity(some))
                if some.type == pa.string():
                    # Arrow has the number of bytes up to the end of each text, from 0 on, as the array is no slice.
                    within = np.frombuffer(some.buffers()[1], np.int32, len(some) + 1)
                    ends.append(within[1:] + ends[-1][-1])
                    yield (some.buffers()[2] or pa.py_buffer(b"")).slice(0, int(within[-1]))
                else:
                    yield some.buffers()[1].slice(0, len(some) * some.type.byte_width)
                self._by_shards.let_go()

        places = [self._by_columns.append(values())]
        if chunks[0].type == pa.string():
            places.insert(0, self._by_columns.append([pa.py_buffer(np.concatenate(ends))]))
        all_valid = np.concatenate(valid)
        # Arrow has one bit a row, the lowest bit of a byte first, and leaves the bitmap out where nothing is null.
        bits = None if all_valid.all() else pa.py_buffer(np.packbits(all_valid, bitorder="little"))
        return (None if bits is None else self._by_columns.append([bits]), *places)

    def _read_column(self, kind: pa.DataType, count: int, places: Iterable[_Place | None]) -> pa.Array:
        buffers = [None if place is None else self._by_columns.read(place) for place in places]
        return pa.Array.from_buffers(kind, count, buffers)

    def let_go(self) -> None:
        """Free the memory of values of `table` that nobody looks at any more."""
        self._by_columns.let_go()

    def close(self) -> None:
        """Close the files; their disk space is freed once nobody has the table any more."""
        self._by_shards.close()
        self._by_columns.close()


class EpisodeRows(Mapping[int, Row]):
    """The row of each trial that has an episode, in order of trials, read from the table of throws one at a time."""

    def __init__(self, throws: pa.Table) -> None:
        self._places = np.flatnonzero(np.concatenate([read_validity(chunk) for chunk in throws["digest"].chunks]))
        self._trials = np.concatenate([read_numbers(chunk) for chunk in throws["trial"].chunks])[self._places]
        self._throws = throws

    def __getitem__(self, trial: int) -> Row:
        """Return the row of a trial."""
        # Trials are in order, so this needs no table of places in memory.
        place = int(np.searchsorted(self._trials, trial))
        if place == len(self) or self._trials[place] != trial:
            raise KeyError(trial)
        row: Row = self._throws.slice(int(self._places[place]), 1).to_pylist()[0]
        return row

    def __iter__(self) -> Iterator[int]:
        return map(int, self._trials)

    def __len__(self) -> int:
        return len(self._trials)
