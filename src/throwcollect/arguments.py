"""Checks arguments of functions that other programs call, and tells a wrong one by its name.

A command that takes such an argument by an option has its users read the name of that option.
"""

from __future__ import annotations

from enum import Enum
from typing import TypeVar

from throwcollect.errors import ConfigError, Problem

_Word = TypeVar("_Word", bound=Enum)


def refuse_argument(
    argument: str, problem: str, *, expected: str | None = None, hint: str | None = None
) -> ConfigError:
    """Make the error that says what is wrong with an argument, of which `argument` is the name."""
    return ConfigError([Problem(problem, argument, argument=True)], expected=expected, hint=hint)


def read_word(argument: str, given: str, words: type[_Word]) -> _Word:
    """Find the member of an enumeration that a word stands for.

    Raises:
        ConfigError: If there is no such member.
    """
    try:
        return words(given)
    except ValueError:
        known = ", ".join(each.value for each in words)
        raise refuse_argument(argument, repr(given), expected=f"one of {known}") from None
