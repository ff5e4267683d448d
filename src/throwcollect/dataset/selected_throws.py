"""Selects rows of the table of throws by a condition, a mask, or numbers of trials."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from throwcollect.errors import ConfigError, DatasetError

_SELECTION = "a condition, an Arrow expression, a mask, or numbers of trials"


def select_throws(throws: pa.Table, which: str | Iterable[Any], directory: Path) -> pa.Table:
    """Select rows of the table of throws of the dataset in a directory; `which` is as for `Dataset.select`.

    Raises:
        ConfigError: If `which` selects no rows of such a table.
        DatasetError: If a trial is not among the throws.
    """
    # These imports take long, and most programs that open a dataset select nothing.
    import pyarrow.compute as pc

    from throwcollect.dataset.expression import Expression

    if isinstance(which, str):
        rows = Expression(which, place="select", is_argument=False).rows(throws)
        return throws.take(pa.array(rows, pa.int64()))
    if isinstance(which, pc.Expression):
        try:
            return throws.filter(which)
        except pa.ArrowException as error:
            raise ConfigError(f"select: {str(error).splitlines()[0]}") from error
    values = _make_array(which)
    if pa.types.is_boolean(values.type):
        if len(values) != len(throws):
            raise ConfigError(
                f"select: a mask of {len(values)}", expected=f"one boolean for each of {len(throws)} throws"
            )
        return throws.filter(values)
    # A number above the largest int64 becomes a negative one, which no trial has.
    rows = pc.index_in(values.cast(pa.int64(), safe=False), value_set=throws["trial"].combine_chunks())
    if rows.null_count:
        missing = values.filter(pc.is_null(rows))[0]
        raise DatasetError(f"no trial {missing} among the {len(throws)} throws", path=directory)
    return throws.take(rows)


def _make_array(which: Any) -> pa.Array:
    """Make an Arrow array of booleans or integers, from whatever holds them."""
    if isinstance(which, pa.ChunkedArray):
        which = which.combine_chunks()
    # Arrow would take the bytes for numbers, and an empty mapping for an empty list.
    if isinstance(which, bytes | bytearray | Mapping):
        raise ConfigError(f"select: {type(which).__name__}", expected=_SELECTION)
    try:
        values = which if isinstance(which, pa.Array) else pa.array(which if hasattr(which, "__len__") else list(which))
    except (pa.ArrowException, KeyError, TypeError, OverflowError) as error:
        raise ConfigError(f"select: {error}", expected=_SELECTION) from error
    # An empty list becomes an array of the type null, which is neither boolean nor integer.
    if not len(values):
        return pa.array([], pa.int64())
    if not (pa.types.is_boolean(values.type) or pa.types.is_integer(values.type)):
        raise ConfigError(f"select: values of type {values.type}", expected=_SELECTION)
    return values
