"""Parquet: a table of throws and tables of samples, for pandas, Polars, DuckDB and dataset hubs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from throwcollect.dataset.directory import THROWS
from throwcollect.plan.parquet_file import encode_table
from throwcollect.publish.export.exporter import Exporter, Layout, tabulate_signals
from throwcollect.publish.export.throw_source import ExportSource, ThrowSeries
from throwcollect.robots.description import robot_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.motions import Motions

PATH = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FILES_PER_CHUNK = 1000
MEGABYTES_PER_FILE = 100
_TABLES_PER_FILE = 5000
"""Most tables in a file: the writer holds 13 kB about each of them in memory until the file is finished."""


class ParquetSeries:
    """Writes tables of one schema into a directory, each as a row group, until it is closed.

    Attributes:
        paths: Files so far.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._writer: pq.ParquetWriter | None = None
        self._tables = 0
        self.paths: list[Path] = []

    def close(self) -> None:
        """Finish the file that is open, if one is."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def place(self) -> tuple[int, int]:
        """Find the numbers of the directory and the file that the next table goes to."""
        if self._tables >= _TABLES_PER_FILE or (
            self.paths and self.paths[-1].stat().st_size >= MEGABYTES_PER_FILE * 2**20
        ):
            self.close()
        # If a file is open, the last path is its path, and the next table goes there.
        return divmod(len(self.paths) - (self._writer is not None), FILES_PER_CHUNK)

    def append(self, table: pa.Table) -> None:
        """Write a table."""
        chunk, file = self.place()
        if self._writer is None:
            path = self._directory / PATH.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema, compression="zstd")
            self.paths.append(path)
            self._tables = 0
        self._writer.write_table(table)
        self._tables += 1


_TRAJECTORIES, _MOTIONS = "trajectories", "motions"
_ROWS_PER_GROUP = 30_000
"""Rows of a row group: enough for columns to compress, few enough to be read for one throw and held in memory."""


def describe(source: ExportSource) -> Layout:
    """Describe how `write` lays a source out."""
    noun, events = source.dataset.config.task.noun, source.dataset.config.task.events
    return Layout(
        files={
            THROWS: f"one row a trial: swept values, outcome, {', '.join(events) or 'measures'}.",
            f"{_TRAJECTORIES}/": f"one row a sample, {noun} after {noun}; `trial` has its number. No {noun} is divided "
            "between files or row groups.",
            f"{_MOTIONS}/": "one row a point of the trajectories that controllers were sent, as `task.trajectory` with "
            "`family: file` reads them.",
        },
        loading=f"""\
import pandas as pd

throws = pd.read_parquet("{THROWS}")
samples = pd.read_parquet("{_TRAJECTORIES}", filters=[("trial", "==", {source.throws[0].trial})])""",
        over_time=tabulate_signals(source, columns=True),
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset as Parquet; see `Exporter.write`."""
    facts = {"throwcollect.digest": source.dataset.digest}
    table = source.table.replace_schema_metadata(facts)
    (directory / THROWS).write_bytes(encode_table(table))
    schema = _make_schema(source).with_metadata(facts)
    (directory / _TRAJECTORIES).mkdir()
    (directory / _MOTIONS).mkdir()
    for shard, throws in source.shards.items():
        path = directory / _TRAJECTORIES / f"{shard}.parquet"
        with pq.ParquetWriter(path, schema, compression="zstd", write_page_checksum=True) as writer:
            group: list[pa.RecordBatch] = []
            sent: dict[str, JointTrajectory] = {}
            for throw in source.read(throws):
                sent[str(throw.throw.trial)] = throw.trajectory
                group.append(_make_batch(throw, source, schema))
                if sum(map(len, group)) >= _ROWS_PER_GROUP or len(sent) == len(throws):
                    writer.write_table(pa.Table.from_batches(group))
                    group = []
        motions = Motions.of(sent, robot_of(source.dataset.config))
        (directory / _MOTIONS / f"{shard}.parquet").write_bytes(encode_table(motions.table()))


def _make_schema(source: ExportSource) -> pa.Schema:
    fields = [pa.field("trial", pa.int64(), nullable=False, metadata={"description": "Number of the trial."})]
    for signal in source.signals:
        metadata = {"description": signal.description, "unit": signal.unit}
        fields += [pa.field(column, pa.float64(), nullable=False, metadata=metadata) for column in signal.columns]
    return pa.schema(fields)


def _make_batch(throw: ThrowSeries, source: ExportSource, schema: pa.Schema) -> pa.RecordBatch:
    columns = [np.full(len(throw), throw.throw.trial)]
    for signal in source.signals:
        # One transposed copy is faster than columns one by one, whose numbers lie far apart in the recorded messages.
        columns += list(np.ascontiguousarray(throw.signals[signal.name].T.reshape(-1, len(throw))))
    return pa.record_batch(columns, schema)


PARQUET = Exporter(describe, write)
