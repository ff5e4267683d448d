"""Begins to serve with the nodes of a process, until a signal asks it to stop."""

from __future__ import annotations

import gc
import signal
from collections.abc import Callable
from types import FrameType

from throwcollect import ros
from throwcollect.own_process import stop_signals


def begin_to_serve(*nodes: ros.Node) -> tuple[ros.Executor, Callable[[], int]]:
    """Put nodes into an executor, which the caller then spins until a signal asks this process to stop.

    Returns:
        The executor, and a function that gives the number of the last signal that asked to stop; 0 if none has.
    """
    executor = ros.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    stopped = 0

    def stop(number: int, _frame: FrameType | None) -> None:
        # Only the loop of the caller acts on it, because a signal may come in the middle of anything.
        nonlocal stopped
        stopped = number
        # That loop may be waiting for messages, and would see `stopped` only after that.
        ros.stop_waiting(executor)

    for number in stop_signals():
        signal.signal(number, stop)
    # The objects made so far stay until the end, so the garbage collector need not go through them again and again.
    gc.freeze()
    return executor, lambda: stopped
