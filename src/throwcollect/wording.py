"""Words parts of messages: counts, lists of names, recommended commands, and characters that are safe to print."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher, get_close_matches

_MOST_NAMES = 6
_MOST_NEAR = 3
_SHORTEST_PART = 3
"""A shorter text is in too many names to be a part of the one that is meant."""
_AS_SIMILAR = 0.03
"""A name is as similar as the most similar one if its ratio of common letters differs by less than this."""
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*(?:e[-+]?\d+)?")


def format_count(number: int, noun: str) -> str:
    """Write a number with a noun, such as ``1 trial`` and ``0 trials``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def join_names(names: Sequence[str], word: str = "and") -> str:
    """List names in a sentence, such as ``a, b and c``; of more than six names, the last ones are only counted."""
    if len(names) > _MOST_NAMES:
        names = [*names[: _MOST_NAMES - 1], f"{len(names) - _MOST_NAMES + 1} more"]
    return f" {word} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def find_near(name: object, known: Iterable[str]) -> list[str]:
    """Find the names that are most like one that does not exist: at most three, the most similar first.

    Names of which it is a part are taken before all others, because prefixes and units are forgotten more often than
    letters are mixed up. Capital letters do not matter.
    """
    if not isinstance(name, str):
        return []
    word, names = name.casefold(), {each.casefold(): each for each in known}
    if len(word) >= _SHORTEST_PART and (longer := [each for each in names if word in each]):
        return [names[each] for each in sorted(longer, key=len)[:_MOST_NEAR]]
    near = get_close_matches(word, names, _MOST_NEAR)
    ratios = [SequenceMatcher(None, each, word).ratio() for each in near]
    return [names[each] for each, ratio in zip(near, ratios, strict=True) if ratio > ratios[0] - _AS_SIMILAR]


def did_you_mean(names: Sequence[str]) -> str:
    """Write the end of a message that asks whether one of these names is meant; empty if there are none."""
    return f"; did you mean {join_names([repr(each) for each in names], 'or')}?" if names else ""


def suggest(name: object, known: Iterable[str], page: str = "") -> str:
    """Write the end of a message on a name that does not exist: which of the known names may be meant.

    If none is like it, all of them are listed if they are few; otherwise the page that lists them is named, if any.
    """
    names = list(known)
    if near := find_near(name, names):
        return did_you_mean(near)
    if page and len(names) > _MOST_NAMES:
        return f"; {page} lists all"
    return f"; known: {join_names(names)}" if names else "; there is none"


def blank_numbers(text: str) -> str:
    """Put ``#`` in place of each number in a text, so that reasons that differ only in numbers count as the same.

    Plans and datasets store reasons only as text. Numbers in names such as ``arm_right_4_joint`` stay.
    """
    return _NUMBER.sub("#", text)


def command(*words: object) -> str:
    """Write a command of throwcollect for a shell, such as ``throwcollect resume 'my data'``."""
    return shlex.join(["throwcollect", *map(str, words)])


def printable(text: str) -> str:
    """Make a message safe for a terminal: escape control characters."""
    # `ascii` writes the escape between two quotes.
    return "".join(each if each.isprintable() or each == "\n" else ascii(each)[1:-1] for each in text)
