"""What the processes of `test_side_by_side` do, apart from pytest, whose import takes most of the time of a process."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

from throwcollect.errors import ConfigError

READ: list[str] = []
"""Values that a process has read; another process has them only if it was forked off."""


def begin(factor: int) -> Callable[[int], tuple[int, int]]:
    return lambda piece: (factor * piece, os.getpid())


def begin_look() -> Callable[[int], tuple[list[str], int]]:
    return lambda _: (READ, os.getpid())


def begin_badly() -> Callable[[int], int]:
    raise ConfigError("nothing to begin with")


def begin_death() -> Callable[[int], None]:
    return lambda piece: os.kill(os.getpid(), signal.SIGKILL) if piece == 3 else None


class SlowlySent(float):
    """A value that is so slow to be sent to a process that several threads start theirs at the same time."""

    def __reduce__(self) -> tuple[type[float], tuple[float]]:
        time.sleep(0.2)
        return float, (float(self),)


def begin_nap(duration_s: float) -> Callable[[int], int]:
    def nap(piece: int) -> int:
        time.sleep(duration_s)
        return piece

    return nap


def begin_sleep() -> Callable[[int], int]:
    def sleep(piece: int) -> int:
        time.sleep(0.01 if piece < 2 else 600)
        return os.getpid()

    return sleep


def begin_long(_directory: object) -> Callable[[int], None]:
    return lambda _piece: time.sleep(600)
