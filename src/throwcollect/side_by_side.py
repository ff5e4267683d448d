"""Work in pieces that processes do side by side, with the results in order."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import Any, TypeVar

from throwcollect.errors import WorkerError
from throwcollect.interruption import die_with_parent

_Piece = TypeVar("_Piece")
_Found = TypeVar("_Found")


def count_cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def work_side_by_side(
    pieces: Sequence[_Piece],
    begin: Callable[..., Callable[[_Piece], _Found]],
    arguments: tuple[Any, ...],
    *,
    processes: int,
    doing: str,
) -> Iterator[_Found]:
    """Do pieces of work in several processes, which import the program that calls this, as `multiprocessing` does.

    Whatever ends this one, Ctrl-C too, ends the others at once.

    Args:
        pieces: The pieces; each is sent to a process.
        begin: Called once in each process; returns what does a piece.
        arguments: What `begin` is called with.
        processes: How many processes there are at most; 1 is this process alone.
        doing: What a process does, for messages: ``checks trials``.

    Yields:
        What came of each piece, in order.

    Raises:
        WorkerError: If a process is killed.
        ThrowcollectError: What a piece raises, when it is its turn.
    """
    # Most commands need neither.
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    processes = min(processes, len(pieces))
    if processes <= 1:
        yield from map(begin(*arguments), pieces)
        return
    others = set(multiprocessing.active_children())
    # New interpreters, as a process that was forked off might hold what threads of this one had locked.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, context, _begin, (partial(begin, *arguments), os.getpid()))
    try:
        # Ctrl-C is for this process, which ends those that start here with the signal blocked.
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            found = pool.map(_work, pieces)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        yield from found
    except BrokenProcessPool as error:
        raise WorkerError(
            f"a process that {doing} was killed", hint="the kernel's log may say why: memory may be short"
        ) from error
    finally:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        pool.shutdown(cancel_futures=True)


_make: list[Callable[[], Callable[[Any], Any]]] = []
"""Gives what does a piece in this process."""


def _begin(make: Callable[[], Callable[[Any], Any]], parent: int) -> None:
    die_with_parent()
    if os.getppid() != parent:
        # It died before it could take this process along.
        os._exit(1)
    # It is made for the first piece and not here, where an error would not reach whoever wants the work done.
    _make[:] = [cache(make)]


def _work(piece: Any) -> Any:
    return _make[0]()(piece)
