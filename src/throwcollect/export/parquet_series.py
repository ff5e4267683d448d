"""Numbered Parquet files of limited size, in numbered directories: ``chunk-000/file-000.parquet``."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

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
