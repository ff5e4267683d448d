"""Words parts of messages: counts, lists of names, recommended commands, and characters that are safe to print."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence

_LONGEST_LINE = 1000
_MOST_NAMES = 6
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*(?:e[-+]?\d+)?")


def format_count(number: int, noun: str) -> str:
    """Write a number with a noun, such as ``1 trial`` and ``0 trials``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def join_names(names: Sequence[str], word: str = "and") -> str:
    """List names in a sentence, such as ``a, b and c``; of more than six names, the last ones are only counted."""
    if len(names) > _MOST_NAMES:
        names = [*names[: _MOST_NAMES - 1], f"{len(names) - _MOST_NAMES + 1} more"]
    return f" {word} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def blank_numbers(text: str) -> str:
    """Put ``#`` in place of each number in a text, so that reasons that differ only in numbers count as the same.

    Plans and datasets store reasons only as text. Numbers in names such as ``arm_right_4_joint`` stay.
    """
    return _NUMBER.sub("#", text)


def command(*words: object) -> str:
    """Write a command of throwcollect for a shell, such as ``throwcollect resume 'my data'``."""
    return shlex.join(["throwcollect", *map(str, words)])


def printable(text: str) -> str:
    """Make a message safe for a terminal: shorten long lines, and escape control characters."""
    return "\n".join(_printable_line(line) for line in text.split("\n"))


def _printable_line(line: str) -> str:
    if len(line) > _LONGEST_LINE:
        line = f"{line[: _LONGEST_LINE // 2]} [...] {line[-_LONGEST_LINE // 2 :]}"
    if line.isprintable():
        return line
    # `ascii` writes the escape between two quotes.
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in line)


def is_text(text: str) -> bool:
    """Say whether a name from the system can be written as UTF-8; the name of a file may hold any bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
