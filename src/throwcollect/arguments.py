"""Checks arguments of functions that other programs call; an error names the argument that is wrong."""

from __future__ import annotations

from enum import Enum
from operator import index
from typing import TypeVar

from throwcollect.errors import ConfigError, Problem
from throwcollect.wording import suggest

_Word = TypeVar("_Word", bound=Enum)


def refuse_argument(
    argument: str, problem: str, *, expected: str | None = None, hint: str | None = None
) -> ConfigError:
    """Make the error that says what is wrong with the argument of a name."""
    return ConfigError([Problem(problem, argument)], expected=expected, hint=hint)


def check_bounds(argument: str, given: int, *, least: int, most: int | None = None) -> None:
    """Refuse an integer that is not from `least` to `most`; None for no upper bound."""
    if index(given) < least or (most is not None and given > most):
        bounds = f"{least} or more" if most is None else f"{least} to {most}"
        raise refuse_argument(argument, f"got {given}", expected=bounds)


def read_word(argument: str, given: str, words: type[_Word]) -> _Word:
    """Find the member of an enumeration that a word stands for."""
    try:
        return words(given)
    except ValueError:
        meant = suggest(given, [each.value for each in words])
        raise refuse_argument(argument, f"{given!r}{meant}") from None
