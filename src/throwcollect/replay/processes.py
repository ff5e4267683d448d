"""Simulates trials in several processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

_AT_ONCE = 4
"""Trials that a process fetches at a time."""

_Found = TypeVar("_Found")


def simulate_side_by_side(
    trials: Sequence[int],
    begin: Callable[..., None],
    arguments: tuple[Any, ...],
    simulate: Callable[[int], _Found],
) -> Iterator[_Found]:
    """Simulate trials on all cores.

    Args:
        trials: Their numbers.
        begin: Makes a process ready; an error there would have it started again for ever.
        arguments: What it is called with.
        simulate: Simulates one trial.

    Yields:
        What came of each, in the given order.
    """
    processes = min(len(os.sched_getaffinity(0)), len(trials))
    if processes == 1:
        begin(*arguments)
        yield from map(simulate, trials)
        return
    # A new interpreter each: the physics engine must not be forked.
    with multiprocessing.get_context("spawn").Pool(processes, _begin_child, (begin, arguments)) as pool:
        yield from pool.imap(simulate, trials, chunksize=_AT_ONCE)


def _begin_child(begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    # Ctrl-C is for the process that started this one, which ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    begin(*arguments)
