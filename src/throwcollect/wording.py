"""How messages put what they count, the commands that they recommend, and what may stand in them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence

_LONGEST_LINE = 1000
_MOST_NAMES = 6
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*(?:e[-+]?\d+)?")


def format_count(number: int, noun: str) -> str:
    """A number and what it counts, such as ``1 trial`` and ``0 trials``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def join_names(names: Sequence[str], word: str = "and") -> str:
    """Names in a sentence, such as ``a, b and c``; of more than six, the others are counted.

    Args:
        names: The names.
        word: What stands before the last one.
    """
    if len(names) > _MOST_NAMES:
        names = [*names[: _MOST_NAMES - 1], f"{len(names) - _MOST_NAMES + 1} more"]
    return f" {word} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def blank_numbers(text: str) -> str:
    """A text with ``#`` in place of each number, so that reasons that differ only in numbers can be counted as one.

    Plans and datasets store reasons as text alone; numbers in names such as ``arm_right_4_joint`` stay.
    """
    return _NUMBER.sub("#", text)


def command(*words: object) -> str:
    """A command of throwcollect as a shell takes it, such as ``throwcollect resume 'my data'``.

    Args:
        words: What follows ``throwcollect``; a path may have blanks.
    """
    return shlex.join(["throwcollect", *map(str, words)])


def printable(text: str) -> str:
    """A message for a terminal: in lines that are not endless, and without characters that would steer it."""
    return "\n".join(_printable_line(line) for line in text.split("\n"))


def _printable_line(line: str) -> str:
    if len(line) > _LONGEST_LINE:
        line = f"{line[: _LONGEST_LINE // 2]} [...] {line[-_LONGEST_LINE // 2 :]}"
    if line.isprintable():
        return line
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in line)


def is_text(text: str) -> bool:
    """Whether a name that the system gave can be written as UTF-8: that of a file may hold any bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
