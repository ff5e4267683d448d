"""Parquet files of a dataset: equal tables are written as equal bytes; what is read may have been made to do harm."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable

_OPENED = "/proc/self/fd/{}"
_MOST_ROWS = 20_000_000
_MOST_VALUES = 2_000_000_000
_BUFFER_BYTES = 1 << 20
"""How much of a column is read at once."""


def encode_table(table: Any) -> bytes:
    """Parquet bytes of an Arrow table; equal tables give equal bytes."""
    pieces: list[bytes] = []
    encode_pieces(table, pieces.append)
    return b"".join(pieces)


def encode_pieces(table: Any, put: Callable[[bytes], object]) -> None:
    """Encode an Arrow table as `encode_table` does, piece by piece and one column of a million rows after the other.

    Args:
        table: The table; of columns that are in one piece, no copy is made.
        put: Called with the bytes, in order.
    """
    import pyarrow.parquet as pq

    pq.write_table(table.combine_chunks(), _Sink(put), compression="zstd", write_page_checksum=True)


class _Sink(io.RawIOBase):
    """A file that Arrow writes to."""

    def __init__(self, put: Callable[[bytes], object]) -> None:
        self._put = put

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        self._put(data)
        return len(data)


def read_parquet(path: Path) -> Any:
    """The Arrow table of a Parquet file, every value of which is valid.

    Raises:
        DatasetError: If the file is missing or damaged, or announces more than any table of a dataset holds.
    """
    with open_parquet(path) as file:
        table = file.read()
        table.validate(full=True)
    return table


@contextmanager
def open_parquet(path: Path) -> Iterator[Any]:
    """A Parquet file, to be read bit by bit; what goes wrong while it is read counts as damage to it.

    Yields:
        A `pyarrow.parquet.ParquetFile`, whose values are not validated yet.

    Raises:
        DatasetError: As for `read_parquet`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        descriptor = open_regular(path)
    except FileNotFoundError as error:
        raise DatasetError("is missing", path=path) from error
    except PermissionError as error:
        raise DatasetError("may not be read", path=path, hint="check who may read it") from error
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        # By its descriptor's name and not as a Python object: Arrow's own threads would call or free that, and one that
        # still waits for the interpreter when this process ends takes the process down.
        with (
            open(descriptor, "rb"),
            pq.ParquetFile(
                _OPENED.format(descriptor), page_checksum_verification=True, buffer_size=_BUFFER_BYTES, pre_buffer=False
            ) as file,
        ):
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if not 0 <= rows <= _MOST_ROWS or rows * columns > _MOST_VALUES:
                raise DatasetError(f"is damaged: announces {rows} rows of {columns} columns", path=path)
            yield file
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        # A name or a text whose bytes are not valid ends as one of these errors, at the latest when it is validated.
        raise DatasetError(f"is damaged: {_first_line(error)}", path=path) from error


def _first_line(error: BaseException) -> str:
    return str(error).partition("\n")[0] or type(error).__name__
