"""Counts signals that ask a command to stop, such as Ctrl-C, while nodes run."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from throwcollect.interruption import stop_signals


@contextmanager
def count_interruptions() -> Iterator[Callable[[], int]]:
    """Count the signals that ask to stop, which would otherwise raise, so that the block can end its nodes properly.

    Only the main thread may use it.

    Yields:
        Returns the number of signals so far.
    """
    count = 0

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    previous = {number: signal.signal(number, note) for number in stop_signals()}
    try:
        yield lambda: count
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
