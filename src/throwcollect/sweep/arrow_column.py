"""Arrow columns of Python values, without what `pyarrow.array` does first: import pandas, wherever that is installed.

To import it takes 0.3 s of a processor, in each process that writes a table; nothing here uses it.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import pyarrow as pa

_CODES = {pa.int64(): "q", pa.uint64(): "Q", pa.float64(): "d"}


def make_column(values: Sequence[Any], kind: pa.DataType) -> pa.Array:
    """What ``pyarrow.array(values, kind)`` gives.

    Args:
        values: Numbers or texts; None for what is null.
        kind: ``int64``, ``uint64``, ``float64`` or ``string``.

    Raises:
        TypeError: If a value is of another kind.
        OverflowError: If a number is too large, or the texts are longer than 2 GiB in all.
    """
    nulls = sum(value is None for value in values)
    valid = np.packbits([value is not None for value in values], bitorder="little") if nulls else None
    if kind == pa.string():
        texts = [b"" if value is None else value.encode() for value in values]
        buffers = [array("i", accumulate(map(len, texts), initial=0)), b"".join(texts)]
    else:
        buffers = [array(_CODES[kind], [0 if value is None else value for value in values] if nulls else values)]
    parts = [None if part is None else pa.py_buffer(part) for part in (valid, *buffers)]
    return pa.Array.from_buffers(kind, len(values), parts, null_count=nulls)


def make_table(columns: Sequence[Sequence[Any]], schema: pa.Schema) -> pa.Table:
    """The Arrow table of columns of Python values.

    Args:
        columns: The columns, each as `make_column` takes it, in the order of the schema.
        schema: Their names and types.
    """
    pairs = zip(columns, schema.types, strict=True)
    return pa.Table.from_arrays([make_column(column, kind) for column, kind in pairs], schema=schema)
