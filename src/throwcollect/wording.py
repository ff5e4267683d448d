"""How messages put what they count, and the commands that they recommend."""

from __future__ import annotations

import shlex


def counted(number: int, noun: str) -> str:
    """A number and what it counts, such as ``1 trial`` and ``0 trials``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def command(*words: object) -> str:
    """A command of throwcollect as a shell takes it, such as ``throwcollect resume 'my data'``.

    Args:
        words: What follows ``throwcollect``; a path may have blanks.
    """
    return shlex.join(["throwcollect", *map(str, words)])
