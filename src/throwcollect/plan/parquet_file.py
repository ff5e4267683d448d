"""Parquet files of a dataset: equal tables give equal bytes, and files of strangers can be read safely."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from throwcollect.errors import DatasetError
from throwcollect.extras import lazily
from throwcollect.files import open_regular, replacing, unreadable

# Nodes import this module, and most of them read no tables.
pa, pq = lazily("pyarrow"), lazily("pyarrow.parquet")
_DESCRIPTOR_PATH = "/proc/self/fd/{}"
_MOST_ROWS = 20_000_000
_MOST_VALUES = 2_000_000_000
_ROWS_A_GROUP = 1 << 16
_BUFFER_BYTES = 1 << 20
"""Number of bytes of a column that are read at once."""


def encode_table(table: Any) -> bytes:
    """Encode an Arrow table as Parquet; equal tables give equal bytes."""
    encoded = io.BytesIO()
    _encode(table, encoded)
    return encoded.getvalue()


def write_table(path: Path, table: Any) -> None:
    """Write the Parquet file of `encode_table`, without holding its bytes in memory."""
    with replacing(path) as descriptor, open(descriptor, "wb", closefd=False) as file:
        _encode(table, file)


def _encode(table: Any, file: BinaryIO) -> None:
    with pq.ParquetWriter(file, table.schema, compression="zstd", write_page_checksum=True) as writer:
        for first in range(0, len(table) or 1, _ROWS_A_GROUP):
            # The bytes must not depend on where a column was cut into pieces; groups are joined one at a time.
            writer.write_table(table.slice(first, _ROWS_A_GROUP).combine_chunks())


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> Any:
    """Read the Arrow table of a Parquet file, or those of some columns that it has, and check every value of it."""
    with open_parquet(path) as file:
        table = file.read(columns)
        table.validate(full=True)
    return table


@contextmanager
def open_parquet(path: Path) -> Iterator[Any]:
    """Open a Parquet file; an error of Arrow inside the ``with`` block counts as damage of the file.

    Yields:
        A `pyarrow.parquet.ParquetFile`, whose values are not validated yet.
    """
    try:
        descriptor = open_regular(path)
    except FileNotFoundError as error:
        raise DatasetError("is missing", path=path) from error
    except PermissionError as error:
        raise DatasetError("may not be read", path=path, hint="check who may read it") from error
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        # Arrow gets the descriptor's name and not a Python object: its own threads would call or free the object, and a
        # thread that still waits for the interpreter when this process ends makes the process crash.
        with (
            open(descriptor, "rb"),
            pq.ParquetFile(
                _DESCRIPTOR_PATH.format(descriptor),
                page_checksum_verification=True,
                buffer_size=_BUFFER_BYTES,
                pre_buffer=False,
            ) as file,
        ):
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if not 0 <= rows <= _MOST_ROWS or rows * columns > _MOST_VALUES:
                raise DatasetError(f"is damaged: announces {rows} rows of {columns} columns", path=path)
            yield file
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        # Names and texts with invalid bytes raise one of these errors, too, at the latest when they are validated.
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise DatasetError(f"is damaged: {reason}", path=path) from error
