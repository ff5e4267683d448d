"""Signals that ask a command to stop, such as Ctrl-C, while nodes run."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

from throwcollect.interruption import stop_signals


class Interruptions:
    """Counts the signals that ask to stop, which would otherwise raise, so that the command can end its nodes in order.

    Use it as a context manager, in the main thread.

    Attributes:
        count: Signals so far.
    """

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> Interruptions:
        self._previous = {number: signal.signal(number, self._note) for number in stop_signals()}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
