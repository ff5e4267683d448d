"""How fast all trajectories of many throws become arrays, and how fast the same files can be decompressed at all.

The raw limit is what nobody who reads these files can do without: to find each chunk and decompress it with zstandard,
in the same process and with one thread; once without and once with its CRC. The `mcap` library's own reader, which
hands out every message by itself, is beside it. All are measured in turns, as the machine's speed drifts.

`python -m bench.reading DIR` measures a dataset that is there.
"""

from __future__ import annotations

import argparse
import math
import mmap
import os
import statistics
import struct
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import zstandard
from isal.isal_zlib import crc32
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader, get_chunk_data_stream

from throwcollect import load
from throwcollect.dataset.reader import Dataset

THROWS = 10_000
COLUMNS = ("stamps_ns", "joints_position", "joints_velocity", "joints_effort", "ball_position", "ball_velocity")
_BY_MESSAGES = 100
"""Throws that the `mcap` library reads; all would take minutes."""
_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<BQQQQII4sQ")
_CHUNK_OPCODE = 6
_MAGIC_BYTES = 8


class Times(NamedTuple):
    """Attributes: what a clock on the wall says, and the processor time of all threads [s]."""

    wall_s: float
    processor_s: float


@dataclass(frozen=True)
class Reading:
    """Times that each way of reading took, once a round.

    Attributes:
        throws: Number of throws.
        compressed_mb: Size of their chunks [MB].
        uncompressed_mb: Size of these when decompressed [MB].
        arrays_mb: Size of the arrays [MB].
        raw: Decompressing.
        raw_crc: Decompressing and comparing CRCs.
        mcap_chunks: The `mcap` library's way to the contents of all chunks, which compares CRCs.
        one_thread: `Dataset.trajectories` with one thread, which compares CRCs.
        moving: The same with the columns of those joints only that the task moves.
        threads: All joints, with as many threads as by default.
        by_messages: The `mcap` library, scaled to all throws.
    """

    throws: int
    compressed_mb: float
    uncompressed_mb: float
    arrays_mb: float
    raw: list[Times]
    raw_crc: list[Times]
    mcap_chunks: list[Times]
    one_thread: list[Times]
    moving: list[Times]
    threads: list[Times]
    by_messages: list[Times]


def measure(directory: Path, *, rounds: int, throws: int = THROWS) -> Reading:
    """Measure all ways of reading.

    Args:
        directory: A finished dataset; its shards stand for as many more as the number of throws needs.
        rounds: How often.
        throws: At least so many are read.
    """
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-", dir=directory.parent) as scratch:
        dataset = _multiply(load(directory).recorded, throws, Path(scratch))
        files = [dataset.directory / name for name in dict.fromkeys(dataset.throws["shard"].to_pylist())]
        before, after = _decompress(files, crc=True)
        arrays_mb = sum(column.nbytes for column in dataset.trajectories(COLUMNS).columns.values()) / 1e6
        few = min(_BY_MESSAGES, dataset.throws["shard"].to_pylist().count(files[0].name))
        times: dict[str, list[Times]] = {}
        for _ in range(rounds):
            for name, read in {
                "raw": lambda: _decompress(files, crc=False),
                "raw_crc": lambda: _decompress(files, crc=True),
                "mcap_chunks": lambda: _decompress_with_mcap(files),
                "one_thread": lambda: dataset.trajectories(COLUMNS, threads=1),
                "moving": lambda: dataset.trajectories(COLUMNS, joints=dataset.moving_joints, threads=1),
                "threads": lambda: dataset.trajectories(COLUMNS),
                "by_messages": lambda: _by_messages(files[0], few),
            }.items():
                times.setdefault(name, []).append(_measure_times(read))
        scale = len(dataset) / few
        times["by_messages"] = [Times(each.wall_s * scale, each.processor_s * scale) for each in times["by_messages"]]
    return Reading(len(dataset), before / 1e6, after / 1e6, arrays_mb, **times)


def _multiply(dataset: Dataset, throws: int, scratch: Path) -> Dataset:
    """At least so many throws: whole copies of all shards, which are links to one file."""
    shards = dataset.throws["shard"].to_pylist()
    column = dataset.throws.schema.get_field_index("shard")
    tables = []
    for copy in range(math.ceil(throws / len(dataset))):
        for name in set(shards):
            os.link(dataset.directory / name, scratch / f"{copy}_{name}")
        names = pa.array([f"{copy}_{name}" for name in shards])
        tables.append(dataset.throws.set_column(column, "shard", names))
    return replace(dataset, directory=scratch, throws=pa.concat_tables(tables))


def _measure_times(read: Callable[[], object]) -> Times:
    wall, processor = time.perf_counter(), time.process_time()
    result = read()
    times = Times(time.perf_counter() - wall, time.process_time() - processor)
    del result
    return times


def _decompress(files: Sequence[Path], *, crc: bool) -> tuple[int, int]:
    """Decompress all chunks; returns the sizes of all before and after [bytes]."""
    decompressor = zstandard.ZstdDecompressor()
    before = after = 0
    for path in files:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            offset = _MAGIC_BYTES
            while offset < len(data) - _MAGIC_BYTES:
                opcode, length = _RECORD.unpack_from(data, offset)
                end = offset + _RECORD.size + length
                if opcode == _CHUNK_OPCODE:
                    said = _CHUNK.unpack_from(data, offset)[5]
                    contents = decompressor.decompress(data[offset + _CHUNK.size : end])
                    if crc and crc32(contents) != said:
                        raise ValueError(f"{path}: byte {offset}: a chunk's CRC differs from its contents")
                    before += end - offset
                    after += len(contents)
                offset = end
    return before, after


def _decompress_with_mcap(files: Sequence[Path]) -> None:
    for path in files:
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    get_chunk_data_stream(record, validate_crc=True)


def _by_messages(path: Path, throws: int) -> None:
    """Read messages of the first throws of a file with the `mcap` library, and leave them as bytes."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        # The first chunk holds the latched messages.
        end_ns = sorted(index.message_end_time for index in summary.chunk_indexes)[throws]
        for _ in reader.iter_messages(ending_at=end_ns):
            pass


def show(found: Reading) -> None:
    """Print a table."""
    ways = {
        "decompressing alone, one thread": found.raw,
        "decompressing and CRC, one thread": found.raw_crc,
        "decompressing and CRC by `mcap`": found.mcap_chunks,
        "`trajectories(threads=1)`": found.one_thread,
        "the same with the moving joints only": found.moving,
        "`trajectories()`": found.threads,
        "`mcap`, message by message": found.by_messages,
    }
    print(f"\n## Reading {found.throws} throws, medians of {len(found.raw)}\n")
    print(f"{found.compressed_mb:.0f} MB of chunks, {found.uncompressed_mb:.0f} MB uncompressed, ", end="")
    print(f"{found.arrays_mb:.0f} MB of arrays ({', '.join(COLUMNS)})\n")
    print("| what | episodes/s | uncompressed MB/s | ratio to decompressing: processor time (wall) ", end="")
    print("| with CRC | by `mcap` |")
    print("|---|---|---|---|---|---|")
    for what, times in ways.items():
        wall_s = statistics.median(each.wall_s for each in times)
        print(f"| {what} | {found.throws / wall_s:.0f} | {found.uncompressed_mb / wall_s:.0f} ", end="")
        for limit in (found.raw, found.raw_crc, found.mcap_chunks):
            print(f"| {ratio(times, limit).processor_s:.2f} ({ratio(times, limit).wall_s:.2f}) ", end="")
        print("|", flush=True)


def ratio(times: Sequence[Times], limit: Sequence[Times]) -> Times:
    """Medians over the rounds of a speed over that of a limit, by both clocks."""
    pairs = list(zip(times, limit, strict=True))
    return Times(
        statistics.median(of.wall_s / each.wall_s for each, of in pairs),
        statistics.median(of.processor_s / each.processor_s for each, of in pairs),
    )


def main() -> None:
    """Measure one dataset."""
    parser = argparse.ArgumentParser(prog="python -m bench.reading", description=__doc__)
    parser.add_argument("directory", type=Path, help="a finished dataset")
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each kind [%(default)s]")
    parser.add_argument("--throws", type=int, default=THROWS, help="at least so many are read [%(default)s]")
    arguments = parser.parse_args()
    show(measure(arguments.directory, rounds=arguments.rounds, throws=arguments.throws))


if __name__ == "__main__":
    main()
