"""Shows the progress of a collection: as a bar on a terminal, and as plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from throwcollect.collect.coordinator.reporter import Reporter

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.progress import Progress

_LINE_EVERY_S = 2.0
"""Least time between two lines."""


def display(*, quiet: bool, bar: bool = True) -> _Lines | _Bar:
    """Choose a display by where standard error goes; a quiet one shows nothing but warnings.

    A run that is detached has no progress, and so no bar.
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
