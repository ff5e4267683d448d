"""How commands print: results to standard output, as text or as JSON, remarks and progress to standard error."""

from __future__ import annotations

import json as jsonlib
import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, is_dataclass
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import typer

from throwcollect.collect.coordinator.reporter import Reporter

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.progress import Progress

_LINE_EVERY_S = 2.0
_REWRITE_S = 0.2
"""Least times between two lines of progress, and between two states of the line in a terminal."""
_CLEAR = "\r\x1b[K"

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


class Display(Reporter, AbstractContextManager["Display"]):
    """Shows progress on standard error: in a terminal as one line that is written anew, else as one every two seconds.

    A quiet display shows nothing but warnings.
    """

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._is_terminal = sys.stderr.isatty()
        self._next = 0.0
        self._shown: Progress | None = None

    def __exit__(self, *_: object) -> None:
        if self._is_terminal and self._shown is not None:
            self.warn(self._shown.line)

    def update(self, progress: Progress) -> None:
        """Take in a progress report of the coordinator."""
        now = time.monotonic()
        # The last trial is shown without delay, but only once: reports go on while the dataset is checked and finished.
        over = progress.ended >= progress.total
        repeated = self._shown is not None and self._shown.outcomes == progress.outcomes
        if self._quiet or (over and repeated) or (not over and now < self._next):
            return
        self._next, self._shown = now + (_REWRITE_S if self._is_terminal else _LINE_EVERY_S), progress
        if self._is_terminal:
            sys.stderr.write(f"{_CLEAR}{progress.line[: shutil.get_terminal_size().columns - 1]}")
            sys.stderr.flush()
        else:
            self.warn(progress.line)

    def say(self, line: str) -> None:
        """Take in a line of information."""
        if not self._quiet:
            self.warn(line)

    def warn(self, line: str) -> None:
        """Take in a warning."""
        print(f"{_CLEAR}{line}" if self._is_terminal else line, file=sys.stderr, flush=True)
