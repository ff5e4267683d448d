"""Splits work into pieces that several processes do at the same time, and returns the results in order."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from types import ModuleType
from typing import Any, Generic, TypeVar

from throwcollect.errors import WorkerError
from throwcollect.extras import lazily
from throwcollect.own_process import die_with_parent

# Most commands need neither.
multiprocessing, futures = lazily("multiprocessing"), lazily("concurrent.futures")

_THROWS_A_START = 20
"""Number of throws that a process simulates in about the time that it takes to start."""

_launch = threading.Lock()
"""Held while processes are started, because that changes what belongs to the whole process for a moment."""

_Piece = TypeVar("_Piece")
_Found = TypeVar("_Found")


def count_cores() -> int:
    """Count the processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def limit_processes(processes: int, throws: int) -> int:
    """Limit the number of processes that simulate throws, as a start takes as long as some throws; it is at least 1."""
    return min(processes, max(1, throws // _THROWS_A_START))


class Workers(Generic[_Piece, _Found]):
    """Processes that do pieces of work, and know nothing of this process but the arguments of `begin`.

    They start when the first pieces are submitted, and end when this process ends, even by Ctrl-C.

    Args:
        begin: Called once in each process; returns the function that does a piece.
        arguments: Arguments of `begin`.
        processes: Largest number of processes.
        doing: Verb and object for messages, such as ``checks trials``.
        fork: Whether to fork the processes off this one, with everything that it has imported and read, if it has only
            one Python thread. The pieces must not use libraries with threads of their own.
    """

    def __init__(
        self,
        begin: Callable[..., Callable[[_Piece], _Found]],
        arguments: tuple[Any, ...],
        *,
        processes: int,
        doing: str,
        fork: bool = False,
    ) -> None:
        # If there are several threads, new interpreters are started: a fork could wait for ever for another thread's
        # lock.
        context = multiprocessing.get_context("fork" if fork and threading.active_count() == 1 else "spawn")
        self._doing = doing
        with launching():
            self._pool = futures.ProcessPoolExecutor(
                processes, context, _begin, (partial(begin, *arguments), os.getpid())
            )

    def submit(self, pieces: Iterable[_Piece]) -> list[Any]:
        """Let the processes do pieces of work, in this order; return a `Future` for each."""
        with launching(), warnings.catch_warnings():
            # From 3.12 on, Python warns about the threads of Arrow and BLAS, which forked processes do not use.
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            return [self._pool.submit(_work, piece) for piece in pieces]

    def wait(self, future: Any) -> _Found:
        """Wait for the result of a piece."""
        try:
            found: _Found = future.result()
            return found
        except futures.process.BrokenProcessPool as error:
            raise WorkerError(
                f"a process that {self._doing} was killed", hint="the kernel's log may say why: memory may be short"
            ) from error

    def close(self) -> None:
        """End the processes at once; a second call does nothing."""
        # `shutdown` waits for pieces that are being worked on, so the processes are killed first. Only the pool knows
        # its own, because other threads start processes, too; before 3.14, Python has no public way to kill them.
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        self._pool.shutdown(cancel_futures=True)


def work_side_by_side(
    pieces: Sequence[_Piece],
    begin: Callable[..., Callable[[_Piece], _Found]],
    arguments: tuple[Any, ...],
    **options: Any,
) -> Iterator[_Found]:
    """Do pieces of work as `working_side_by_side` does, from the request for the first result to the last result."""
    with working_side_by_side(pieces, begin, arguments, **options) as found:
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
    """Do pieces of work in `Workers`, or in this process if one process, or one piece, is enough.

    The processes begin at once, so this process can do something else meanwhile, and end with the block.

    Yields:
        The results, in the order of the pieces.
    """
    processes = min(processes, len(pieces))
    if processes <= 1:
        yield map(begin(*arguments), pieces)
        return
    workers = Workers(begin, arguments, processes=processes, doing=doing, fork=fork)
    try:
        futures = deque(workers.submit(pieces))
        # Each result is freed when it has been used.
        yield (workers.wait(futures.popleft()) for _ in range(len(futures)))
    finally:
        workers.close()


@contextmanager
def launching() -> Iterator[None]:
    """Let processes that start in the block not import the user's program, which may do its work when it is imported.

    Only this process shall see Ctrl-C and then end the others, so these start with the signal blocked.
    """
    with _launch:
        program = sys.modules["__main__"]
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = program
            signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)


_make: list[Callable[[], Callable[[Any], Any]]] = []
"""Holds the function that makes the function that does a piece in this process; empty before the process begins."""


def _begin(make: Callable[[], Callable[[Any], Any]], parent: int) -> None:
    die_with_parent(parent)
    # What engines and tasks of other packages print must not mix with the output of a command.
    os.dup2(2, 1)
    # The objects made so far live until the end, so the garbage collector need not examine them again and again.
    gc.freeze()
    # The function is made with the first piece, because an error here would not reach the parent.
    _make[:] = [cache(make)]


def _work(piece: Any) -> Any:
    return _make[0]()(piece)
