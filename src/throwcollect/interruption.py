"""Reasons for a process to end: signals that ask for it, such as Ctrl-C, and the death of its parent."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_PR_SET_PDEATHSIG = 1
"""prctl(2): the signal that a process gets when its parent dies."""
# The C library that this process has loaded already; Python itself has no `prctl`.
_LIBC = ctypes.CDLL(None)


def stop_signals() -> tuple[signal.Signals, ...]:
    """List the signals that ask this process to end: SIGINT, SIGTERM, and SIGHUP, which a closed terminal sends.

    Those that this process ignores are left out. `nohup` arranges that for SIGHUP, and shells arrange it for SIGINT if
    a script starts a command with `&`.
    """
    asking = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    return tuple(number for number in asking if signal.getsignal(number) is not signal.SIG_IGN)


def leave_when_stopped() -> None:
    """Let signals end this process at once, because it has not yet begun anything that has to be ended in order.

    A handler that raises an exception would not do, because a library that is being imported may ignore it.
    """
    for number in stop_signals():
        signal.signal(number, _leave)


def _leave(_number: int, _frame: FrameType | None) -> NoReturn:
    os._exit(130)


@contextmanager
def count_interruptions(numbers: Iterable[signal.Signals] | None = None) -> Iterator[Callable[[], int]]:
    """Count signals instead of letting them raise or end this process, so that the block can end its nodes in order.

    In other threads than the main one none are counted, because signals never reach them.

    Args:
        numbers: The signals; None counts all that ask to stop, such as Ctrl-C.

    Yields:
        Returns the number of signals so far.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: 0
        return
    count = 0

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    counted = stop_signals() if numbers is None else numbers
    previous = {number: signal.signal(number, note) for number in counted}
    try:
        yield lambda: count
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def die_with_parent(parent: int) -> None:
    """Ask the kernel to kill this process when its parent dies; a child has to call it right after the fork.

    `parent` is the process id of the parent. If the parent has died before the call, the kernel will send no signal, so
    this process ends at once.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
