"""Splits work into pieces that several processes do at the same time, and returns the results in order."""

from __future__ import annotations

import gc
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, TypeVar

from throwcollect.errors import WorkerError
from throwcollect.interruption import die_with_parent

_THROWS_A_START = 20
"""Number of throws that a process simulates in about the time that it takes to start."""

_Piece = TypeVar("_Piece")
_Found = TypeVar("_Found")


def count_cores() -> int:
    """Count the processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def limit_processes(processes: int, throws: int) -> int:
    """Limit the number of processes that simulate throws, as a start takes as long as some throws; it is at least 1."""
    return min(processes, max(1, throws // _THROWS_A_START))


def work_side_by_side(
    pieces: Sequence[_Piece],
    begin: Callable[..., Callable[[_Piece], _Found]],
    arguments: tuple[Any, ...],
    *,
    processes: int,
    doing: str,
    fork: bool = False,
) -> Iterator[_Found]:
    """Do pieces of work as `working_side_by_side` does, from the request for the first result to the last result."""
    with working_side_by_side(pieces, begin, arguments, processes=processes, doing=doing, fork=fork) as found:
        yield from found


@contextmanager
def working_side_by_side(
    pieces: Sequence[_Piece],
    begin: Callable[..., Callable[[_Piece], _Found]],
    arguments: tuple[Any, ...],
    *,
    processes: int,
    doing: str,
    fork: bool = False,
) -> Iterator[Iterator[_Found]]:
    """Do pieces of work in several processes, which import the calling program, as `multiprocessing` does.

    The processes begin at once, so this process can do something else meanwhile. They end at once when this process or
    the block ends, even by Ctrl-C.

    Args:
        pieces: The pieces; each is sent to a process.
        begin: Called once in each process; returns the function that does a piece.
        arguments: Arguments of `begin`.
        processes: Largest number of processes; with 1, this process does the work itself.
        doing: Verb and object for messages, such as ``checks trials``.
        fork: Whether to fork the processes off this one, with everything that it has imported and read, if it has only
            one Python thread. The pieces must not use libraries with threads of their own.

    Yields:
        The results, in the order of the pieces.
    """
    # Imported here, because most commands need neither.
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    processes = min(processes, len(pieces))
    if processes <= 1:
        yield map(begin(*arguments), pieces)
        return
    # If there are several threads, new interpreters are started: a fork could wait for ever for another thread's lock.
    context = multiprocessing.get_context("fork" if fork and threading.active_count() == 1 else "spawn")
    pool = ProcessPoolExecutor(processes, context, _begin, (partial(begin, *arguments), os.getpid()))
    try:
        # Only this process shall see Ctrl-C and then end the others, so the others start with the signal blocked.
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            with warnings.catch_warnings():
                # From 3.12 on, Python warns about the threads of Arrow and BLAS, which forked processes do not use.
                warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
                found = pool.map(_work, pieces)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        yield found
    except BrokenProcessPool as error:
        raise WorkerError(
            f"a process that {doing} was killed", hint="the kernel's log may say why: memory may be short"
        ) from error
    finally:
        # `shutdown` waits for pieces that are being worked on, so the processes are killed first. Only the pool knows
        # its own, because other threads start processes, too; before 3.14, Python has no public way to kill them.
        for process in list(pool._processes.values()):
            process.kill()
        pool.shutdown(cancel_futures=True)


_make: list[Callable[[], Callable[[Any], Any]]] = []
"""Holds the function that makes the function that does a piece in this process; empty before the process begins."""


def _begin(make: Callable[[], Callable[[Any], Any]], parent: int) -> None:
    die_with_parent(parent)
    # The objects made so far live until the end, so the garbage collector need not examine them again and again.
    gc.freeze()
    # The function is made with the first piece, because an error here would not reach the parent.
    _make[:] = [cache(make)]


def _work(piece: Any) -> Any:
    return _make[0]()(piece)
