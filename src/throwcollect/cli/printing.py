"""How commands print: results to standard output, as text or as JSON, and remarks to standard error."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from datetime import datetime
from functools import partial
from typing import Any

import typer

tell = partial(typer.echo, err=True)
"""Print a remark to standard error, where it does not mix with the result."""


def print_progress(wanted: bool = True) -> None:
    """Print, or do not print, from now on what is logged about long work: to standard error, as a remark."""
    import logging

    from throwcollect.progress_log import LOGGER

    logger = logging.getLogger(LOGGER)
    logger.setLevel(logging.INFO)
    logger.handlers = [logging.StreamHandler()] if wanted else []


def show(result: object, *lines: str, json: bool, indent: int | None = 2) -> None:
    """Print the result of a command: as a JSON document for programs, or as lines for people.

    Values in the result may also be dataclasses, models of pydantic, paths and instants. Without `indent`, the document
    is one line.
    """
    if json:
        typer.echo(jsonlib.dumps(result, indent=indent, default=_make_plain))
    elif lines:
        typer.echo("\n".join(lines))


def _make_plain(value: Any) -> object:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, datetime):
        return value.isoformat(timespec="milliseconds")
    return value.model_dump(mode="json") if hasattr(value, "model_dump") else str(value)


def format_number(number: float | None) -> str:
    """Write a number with six digits, and ``-`` where there is none."""
    return "-" if number is None else f"{number:.6g}"


def align(rows: Sequence[Sequence[str]], *, numbers: bool = False) -> list[str]:
    """Write rows as lines with aligned columns; numbers, which are all but the first column, end below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    fill = str.rjust if numbers else str.ljust
    return ["  ".join([row[0].ljust(widths[0]), *map(fill, row[1:], widths[1:])]).rstrip() for row in rows]
