"""Reads Parquet files that may be damaged, or made to do harm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, unreadable

_OPENED = "/proc/self/fd/{}"
_MOST_ROWS = 20_000_000
_MOST_VALUES = 2_000_000_000


def read_parquet(path: Path) -> Any:
    """The Arrow table of a Parquet file, every value of which is valid.

    Raises:
        DatasetError: If the file is missing or damaged, or announces more than any table of a dataset holds.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        descriptor = open_regular(path)
    except FileNotFoundError as error:
        raise DatasetError(f"{path}: is missing") from error
    except PermissionError as error:
        raise DatasetError(f"{path}: may not be read", hint="check who may read it") from error
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        # By its descriptor's name and not as a Python object: Arrow's own threads would call or free that, and one that
        # still waits for the interpreter when this process ends takes the process down.
        with (
            open(descriptor, "rb"),
            pq.ParquetFile(_OPENED.format(descriptor), page_checksum_verification=True) as file,
        ):
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if not 0 <= rows <= _MOST_ROWS or rows * columns > _MOST_VALUES:
                raise DatasetError(f"{path}: is damaged: announces {rows} rows of {columns} columns")
            table = file.read()
        table.validate(full=True)
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        # Whatever the bytes of a name or a text are not valid as ends as one of these, at the latest when validated.
        raise DatasetError(f"{path}: is damaged: {_first_line(error)}") from error
    return table


def _first_line(error: BaseException) -> str:
    return str(error).partition("\n")[0] or type(error).__name__
