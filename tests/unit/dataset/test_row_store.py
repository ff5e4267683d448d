"""Rows of the table of throws are kept on the disk: many rows need little memory."""

import gc
import itertools
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import create_and_open

from throwcollect.dataset import writer
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.manifest import FileEntry
from throwcollect.dataset.row_store import EpisodeRows, RowStore
from throwcollect.dataset.shard import FinishedShard
from throwcollect.errors import DatasetError
from throwcollect.sweep.parquet_file import encode_pieces, encode_table
from throwcollect.tasks.measures import BallState
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

TRIALS = 2000
PER_SHARD = 100
MOST_BYTES = 60
"""Memory that a trial of a finished shard may take [bytes]; in a table in memory its row would take 500."""
SCHEMA = pa.schema({"trial": pa.int64(), "reason": pa.string(), "speed": pa.float64(), "digest": pa.string()})


class ShardWithoutFile:
    """Replaces `OpenShard` and writes no file."""

    def __init__(self, path: Path, _channels: object) -> None:
        self.path = path
        self.missing: set[int] = set()
        self.rows: dict[int, Any] = {}
        self.offsets: dict[int, int] = {}

    def append(self, episode: Any) -> None:
        self.missing.remove(episode.header.trial)
        self.offsets[episode.header.trial] = 1000 * len(self.offsets)

    def finish(self) -> FinishedShard:
        name = self.path.name
        return FinishedShard((FileSummary(name, 0, 1, {}), FileEntry(name, 1, "0" * 64)), self.offsets)


def rows(first: int, count: int) -> pa.Table:
    random = np.random.default_rng(first)
    lost = random.random(count) < 0.1
    digits = random.bytes(32 * count).hex()
    digests = [None if none else digits[64 * at : 64 * at + 64] for at, none in enumerate(lost.tolist())]
    columns = [
        pa.array(range(first, first + count)),
        pa.array([f"{number} fell" if number % 7 else None for number in range(count)]),
        pa.array(random.random(count), mask=lost),
        pa.array(digests, pa.string()),
    ]
    return pa.Table.from_arrays(columns, schema=SCHEMA)


def append(filled: writer.DatasetWriter, trial: int) -> None:
    random = np.random.default_rng(trial)
    time_s, *numbers = random.random(7).tolist()
    ball = BallState(time_s, tuple(numbers[:3]), tuple(numbers[3:]))
    result = ThrowResult(ThrowOutcome.LANDED, reason=f"it was trial {trial}", release=ball, apex=ball, landing=ball)
    header = SimpleNamespace(trial=trial, samples=300)
    filled.append(SimpleNamespace(header=header, digest=random.bytes(32).hex()), result)  # type: ignore[arg-type]


def test_a_trial_of_a_finished_shard_takes_little_memory(
    make_collection: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "OpenShard", ShardWithoutFile)
    plan = make_collection({"trials": TRIALS, "record": {"trials_per_shard": PER_SHARD}}).plan
    filled = create_and_open(tmp_path / "dataset", plan)
    used = []
    tracemalloc.start()
    try:
        for trial in range(TRIALS):
            append(filled, trial)
            if trial + 1 in (PER_SHARD, TRIALS):
                gc.collect()
                used.append(tracemalloc.get_traced_memory()[0] + pa.total_allocated_bytes())
    finally:
        tracemalloc.stop()
    assert (used[1] - used[0]) / (TRIALS - PER_SHARD) < MOST_BYTES
    assert filled.finish() == {"landed": TRIALS}
    assert pq.read_table(tmp_path / "dataset" / "throws.parquet")["trial"].to_pylist() == list(range(TRIALS))
    filled.close()


def test_the_table_of_a_row_store_equals_a_table_made_in_memory(tmp_path: Path) -> None:
    store = RowStore(tmp_path, SCHEMA)
    # So many rows that a dictionary ends within a column, and pages end elsewhere than the pieces.
    pieces = [rows(first, 21_000) for first in range(0, 168_000, 21_000)]
    for number in (3, 0, 7, 1, 2, 6, 5, 4):
        store.put(number, pieces[number])
    whole = pa.concat_tables(pieces)
    assert store.table.equals(whole)
    assert store.table.schema.equals(SCHEMA, check_metadata=True)
    store.let_go()
    store.close()
    assert encode_table(store.table) == encode_table(whole)
    assert list(tmp_path.iterdir()) == []


def test_a_table_is_encoded_in_small_pieces() -> None:
    table = pa.table(
        {"one": np.random.default_rng(1).random(400_000), "other": np.random.default_rng(2).random(400_000)}
    )
    sizes: list[int] = []
    encode_pieces(table, lambda data: sizes.append(len(data)))
    assert max(sizes) < sum(sizes) / 5


def test_rows_of_episodes_are_only_of_trials_with_an_episode(tmp_path: Path) -> None:
    store = RowStore(tmp_path, SCHEMA)
    for number, first in enumerate((0, 500)):
        store.put(number, rows(first, 500))
    expected = {row["trial"]: row for row in store.table.to_pylist() if row["digest"] is not None}
    found = EpisodeRows(store.table)
    assert dict(found) == expected
    assert list(found) == sorted(expected)
    missing = next(trial for trial in itertools.count() if trial not in expected)
    for trial in (missing, -1, 1000):
        with pytest.raises(KeyError):
            found[trial]


def test_rows_that_cannot_be_written_are_an_error(tmp_path: Path) -> None:
    store = RowStore(tmp_path / "gone", SCHEMA)
    with pytest.raises(DatasetError, match=r"gone/throws\.parquet: cannot be written: No such file or directory"):
        store.put(0, rows(0, 5))
