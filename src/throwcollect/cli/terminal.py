"""What people see while a collection runs: a progress bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import TYPE_CHECKING

from throwcollect.runs.onlooker import Onlooker

if TYPE_CHECKING:
    from throwcollect.coordinator.progress import Progress

_LINE_EVERY_S = 2.0

_TEXT_COLUMNS = 72
"""Width of everything beside the bar."""


class Display(Onlooker, ABC):
    """Shows the progress of a run; a context manager."""

    @abstractmethod
    def __enter__(self) -> Display: ...

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def display(*, quiet: bool, bar: bool = True) -> Display:
    """The display that fits where standard error goes.

    Args:
        quiet: Show nothing but warnings.
        bar: Whether there will be progress to show.
    """
    if sys.stderr.isatty() and bar and not quiet:
        return _Bar()
    return _Lines(quiet=quiet)


class _Lines(Display):
    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._next = 0.0
        self._said: Progress | None = None

    def __enter__(self) -> _Lines:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def update(self, progress: Progress) -> None:
        now = time.monotonic()
        # The last trial is told at once, but only once: reports go on while the dataset is checked and finished.
        over = progress.ended >= progress.total
        told = self._said is not None and self._said.outcomes == progress.outcomes
        if (over and told) or (not over and now < self._next):
            return
        self._next, self._said = now + _LINE_EVERY_S, progress
        self.say(progress.line)

    def say(self, line: str) -> None:
        if not self._quiet:
            self.warn(line)

    def warn(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)


class _Bar(Display):
    def __init__(self) -> None:
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        console = Console(stderr=True)
        self._bar = progress.BarColumn()
        whole = Column(no_wrap=True, overflow="ellipsis")
        self._progress = progress.Progress(
            self._bar,
            progress.MofNCompleteColumn(table_column=whole),
            progress.TextColumn("{task.description}", table_column=whole.copy()),
            progress.TextColumn("ETA", table_column=whole.copy()),
            progress.TimeRemainingColumn(compact=True, table_column=whole.copy()),
            console=console,
        )
        self._task = self._progress.add_task("waiting for simulations", total=None)

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def update(self, progress: Progress) -> None:
        completed, total = progress.steps
        # The terminal may have another width by now.
        self._bar.bar_width = min(max(self._progress.console.width - _TEXT_COLUMNS, 4), 40)
        self._progress.update(self._task, total=total, completed=completed, description=progress.counts)

    def say(self, line: str) -> None:
        self.warn(line)

    def warn(self, line: str) -> None:
        self._progress.console.print(line, markup=False, highlight=False, soft_wrap=True)
