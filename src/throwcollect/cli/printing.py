"""How commands print: results to standard output, as text or as JSON, remarks and progress to standard error."""

from __future__ import annotations

import json as jsonlib
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
"""Least time between two lines of progress."""

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


def display(*, quiet: bool, bar: bool = True) -> _Lines | _Bar:
    """Choose a display of the progress of a collection by where standard error goes.

    A quiet one shows nothing but warnings; a run that is detached has no progress, and so no bar.
    """
    if sys.stderr.isatty() and bar and not quiet:
        return _Bar()
    return _Lines(quiet=quiet)


class _Lines(Reporter, AbstractContextManager["_Lines"]):
    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._next = 0.0
        self._shown: Progress | None = None

    def __exit__(self, *_: object) -> None:
        pass

    def update(self, progress: Progress) -> None:
        now = time.monotonic()
        # The last trial is shown without delay, but only once: reports go on while the dataset is checked and finished.
        over = progress.ended >= progress.total
        repeated = self._shown is not None and self._shown.outcomes == progress.outcomes
        if (over and repeated) or (not over and now < self._next):
            return
        self._next, self._shown = now + _LINE_EVERY_S, progress
        self.say(progress.line)

    def say(self, line: str) -> None:
        if not self._quiet:
            self.warn(line)

    def warn(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)


class _Bar(Reporter):
    def __init__(self) -> None:
        from rich import progress
        from rich.console import Console
        from rich.table import Column
        from rich.text import Text

        class Counts(progress.ProgressColumn):
            """The outcomes in words, which are cut in a narrow terminal so that the numbers are not."""

            def render(self, task: progress.Task) -> Text:
                return Text(task.description, no_wrap=True, overflow="ellipsis")

        self._progress = progress.Progress(
            progress.MofNCompleteColumn(table_column=Column(no_wrap=True)),
            Counts(),
            progress.TextColumn("ETA"),
            progress.TimeRemainingColumn(compact=True, table_column=Column(no_wrap=True)),
            progress.BarColumn(bar_width=20, table_column=Column(no_wrap=True)),
            console=Console(stderr=True),
        )
        self._task = self._progress.add_task("waiting for simulations", total=None)

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def update(self, progress: Progress) -> None:
        completed, total = progress.steps
        self._progress.update(self._task, total=total, completed=completed, description=progress.counts)

    def say(self, line: str) -> None:
        self.warn(line)

    def warn(self, line: str) -> None:
        self._progress.console.print(line, markup=False, highlight=False, soft_wrap=True)
