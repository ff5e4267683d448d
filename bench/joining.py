"""How long it takes to plan, submit and join very many slices, and how much memory that needs.

The slices are made from copies of one: their recordings are links to one file, and their tables its rows under other
numbers. Each size is measured in a process of its own, so that its largest memory is known.

`python -m bench.joining` measures 10^4, 10^5 and 10^6 trials.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pyarrow as pa

from bench.collection import draw_unchecked_plan
from throwcollect.collect.cluster.submit import submit
from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.collect.runs.preparation import prepare
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.creation import create
from throwcollect.dataset.directory import MANIFEST, PLAN, THROWS, shard_name
from throwcollect.dataset.manifest import entry_of, manifest_text, read_manifest
from throwcollect.dataset.slices import join, slice_directory
from throwcollect.plan.parquet_file import encode_table, read_parquet
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
PER_SHARD = 1000
SIZES = (10_000, 100_000, 1_000_000)
_T = TypeVar("_T")
_SETTINGS = ("sim.engine=ballistic", "run.runtime=inprocess", "run.replay=0", f"record.trials_per_shard={PER_SHARD}")


def _collect_one(directory: Path) -> None:
    """Collect one shard, whose copies stand for all."""
    with prepare(CONFIG, overrides=[*_SETTINGS, f"trials={PER_SHARD}"], output=directory) as run:
        run.collect()


def _make_slices(directory: Path, plan: Plan, one: Path) -> None:
    config = plan.config
    rows = read_parquet(one / THROWS)
    # Trials that were refused have no episode, but the plan, which is not checked here, refuses none.
    rows = rows.filter(rows["shard"].is_valid())
    rows = rows.take([number % len(rows) for number in range(PER_SHARD)])
    recording = one / shard_name(config.name, 0)
    entry = next(each for each in read_manifest(one) if each.path == recording.name)
    for slice in Slice.all_of(len(plan.trials) // PER_SHARD):
        place = slice_directory(directory, slice)
        place.mkdir(parents=True)
        name = shard_name(config.name, slice.index)
        os.link(recording, place / name)
        table = _renumber(rows, slice.index, name)
        table_bytes = encode_table(table)
        (place / THROWS).write_bytes(table_bytes)
        entries = [
            entry_of(THROWS, table_bytes),
            entry_of(PLAN, plan.slice_of(slice).encode()),
            type(entry)(name, entry.bytes, entry.sha256),
        ]
        (place / MANIFEST).write_text(manifest_text(config.name, entries))


def _renumber(rows: pa.Table, shard: int, name: str) -> pa.Table:
    trials = pa.array([shard * PER_SHARD + number for number in range(len(rows))], pa.int64())
    columns = {"trial": trials, "shard": pa.array([name] * len(rows))}
    for column, values in columns.items():
        index = rows.schema.get_field_index(column)
        rows = rows.set_column(index, rows.schema.field(column), values)
    return rows


def _measure(trials: int, one: Path, scratch: Path) -> None:
    """Print the times for one size, as a row of the table."""
    config: Config = load(CONFIG, [*_SETTINGS, f"trials={trials}"])
    tasks = trials // PER_SHARD
    planned, plan = _measure_time(lambda: draw_unchecked_plan(config))
    frozen, _ = _measure_time(lambda: create(scratch / "data", plan))
    changes = [*_SETTINGS, f"trials={trials}"]
    submitted, _ = _measure_time(
        lambda: submit(CONFIG, scratch / "dry", tasks, overrides=changes, dry=True, reporter=SILENT)
    )
    _make_slices(scratch / "data", plan, one)
    before_mb = _peak_mb()
    joined, _ = _measure_time(lambda: join(scratch / "data"))
    print(
        f"| {trials} | {tasks} | {planned:.1f} | {frozen:.1f} | {submitted:.2f} | {joined:.1f} "
        f"| {joined / trials * 1e6:.0f} | {before_mb:.0f} | {_peak_mb():.0f} |",
        flush=True,
    )


def _measure_time(work: Callable[[], _T]) -> tuple[float, _T]:
    began = time.perf_counter()
    result = work()
    return time.perf_counter() - began, result


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Measure all sizes, or the one that a process is started for."""
    parser = argparse.ArgumentParser(prog="python -m bench.joining", description=__doc__)
    parser.add_argument("trials", type=int, nargs="*", default=SIZES, help="numbers of trials [%(default)s]")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as directory:
        scratch = Path(directory)
        if arguments.one is not None:
            _measure(arguments.trials[0], arguments.one, scratch)
            return
        _collect_one(scratch / "one")
        print("| trials | slices | drawing [s] | freezing [s] | dry submission [s] | joining [s] ", end="")
        print("| per trial [us] | memory before joining [MB] | largest memory [MB] |")
        print("|---|---|---|---|---|---|---|---|---|", flush=True)
        for trials in arguments.trials:
            command = [sys.executable, "-m", "bench.joining", str(trials), "--one", str(scratch / "one")]
            subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
