"""Checks arguments of functions that other programs call, and tells a wrong one by its name.

A command that takes such an argument by an option has its users read the name of that option.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from numbers import Integral
from typing import Any, TypeVar

from throwcollect.errors import ConfigError, Problem

_LONGEST_QUOTE = 80
"""Characters of a value that a message shows."""
_Word = TypeVar("_Word", bound=Enum)


def refuse_argument(
    argument: str, problem: str, *, expected: str | None = None, hint: str | None = None
) -> ConfigError:
    """Make the error that says what is wrong with an argument, of which `argument` is the name."""
    return ConfigError([Problem(problem, argument, argument=True)], expected=expected, hint=hint)


def show_value(given: object) -> str:
    """Write a value, a text in quotes, and cut it where a message would become too long."""
    text = repr(given) if isinstance(given, str) else str(given)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


def check_list(argument: str, given: object, of: str, *, texts: bool = False) -> None:
    """Refuse what is no list, as a text would be taken letter by letter, and a mapping key by key.

    Args:
        argument: Name of the argument.
        given: Its value; what can be iterated over once is left as it is.
        of: What it should be a list of, such as ``names``.
        texts: Whether these are texts, so that a single one belongs into a list.

    Raises:
        ConfigError: If it is a text or a mapping, or cannot be iterated over.
    """
    kind = "a text" if isinstance(given, str | bytes) else "a mapping" if isinstance(given, Mapping) else None
    if kind is None:
        try:
            iter(given)  # type: ignore[call-overload]
        except TypeError:
            kind = "no list"
    if kind is not None:
        example = f": [{given!r}]" if texts and isinstance(given, str) else ""
        raise refuse_argument(argument, f"{show_value(given)} is {kind}", expected=f"a list of {of}{example}")


def read_list(argument: str, given: Any, of: str, kinds: tuple[type, ...] = (str,)) -> tuple[Any, ...]:
    """Read a list whose elements are of these kinds; the other arguments are those of `check_list`.

    Raises:
        ConfigError: If it is no list, or an element is of another kind.
    """
    check_list(argument, given, of, texts=str in kinds)
    elements = tuple(given)
    for each in elements:
        if not isinstance(each, kinds):
            raise refuse_argument(argument, f"{show_value(each)} is in the list", expected=f"a list of {of}")
    return elements


def check_mapping(argument: str, given: object, example: str) -> None:
    """Refuse what does not map keys to values, such as those of `example`.

    Raises:
        ConfigError: If it is no mapping, or a key in it is no text.
    """
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise refuse_argument(argument, f"got {show_value(given)}", expected=f"a mapping, such as {example}")


def is_whole(given: object) -> bool:
    """Whether a value is a whole number; True and False are none."""
    return isinstance(given, Integral) and not isinstance(given, bool)


def check_whole_number(argument: str, given: Any, *, least: int, most: int | None = None) -> None:
    """Refuse what is no whole number of at least `least`, and at most `most` if there is such a bound.

    Raises:
        ConfigError: If it is none.
    """
    whole = is_whole(given)
    if not whole or given < least or (most is not None and given > most):
        bounds = f"{least} or more" if most is None else f"{least} to {most}"
        expected = bounds if whole else f"a whole number, {bounds}"
        raise refuse_argument(argument, f"got {show_value(given)}", expected=expected)


def as_float(given: Any) -> float:
    """Make a number of a value; NaN if it is none, for a caller that refuses numbers that are not finite."""
    try:
        return float(given)
    except (TypeError, ValueError, OverflowError):
        return math.nan


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
