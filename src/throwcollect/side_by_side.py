"""Work in pieces that processes do side by side, with the results in order."""

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
    fork: bool = False,
) -> Iterator[_Found]:
    """Do what `working_side_by_side` does, from when the first result is asked for to when the last one is had."""
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
    """Do pieces of work in several processes, which import the program that calls this, as `multiprocessing` does.

    They begin at once, and this one may do something else meanwhile. Whatever ends it or the block, Ctrl-C too, ends
    them at once.

    Args:
        pieces: The pieces; each is sent to a process.
        begin: Called once in each process; returns what does a piece.
        arguments: What `begin` is called with.
        processes: How many processes there are at most; 1 is this process alone.
        doing: What a process does, for messages: ``checks trials``.
        fork: Whether processes are forked off this one, with all that it has imported and read, if it has one thread of
            Python. The libraries that they use must not mind that: the ones with threads of their own are not used.

    Yields:
        Gives what came of each piece, in order.

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
        yield _do_here(pieces, begin, arguments)
        return
    others = set(multiprocessing.active_children())
    # New interpreters otherwise, as a process that was forked off might wait for what threads of this one had locked.
    context = multiprocessing.get_context("fork" if fork and threading.active_count() == 1 else "spawn")
    pool = ProcessPoolExecutor(processes, context, _begin, (partial(begin, *arguments), os.getpid()))
    try:
        # Ctrl-C is for this process, which ends those that start here with the signal blocked.
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            with warnings.catch_warnings():
                # Arrow and BLAS have threads, which are not used by those that are forked. Python warns from 3.12 on.
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
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        pool.shutdown(cancel_futures=True)


def _do_here(
    pieces: Sequence[_Piece], begin: Callable[..., Callable[[_Piece], _Found]], arguments: tuple[Any, ...]
) -> Iterator[_Found]:
    yield from map(begin(*arguments), pieces)


_make: list[Callable[[], Callable[[Any], Any]]] = []
"""Gives what does a piece in this process."""


def _begin(make: Callable[[], Callable[[Any], Any]], parent: int) -> None:
    die_with_parent(parent)
    # What is here now stays until the end; the garbage collector need not go through it again and again.
    gc.freeze()
    # It is made for the first piece and not here, where an error would not reach whoever wants the work done.
    _make[:] = [cache(make)]


def _work(piece: Any) -> Any:
    return _make[0]()(piece)
