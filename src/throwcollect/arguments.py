"""Checks arguments of functions that other programs call; an error names the argument that is wrong.

If a command takes the argument by an option, its message names the option instead.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Mapping
from enum import Enum
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from throwcollect.errors import ConfigError, Problem
from throwcollect.wording import suggest

_LONGEST_QUOTE = 80
"""Characters of a value that a message shows."""
_Word = TypeVar("_Word", bound=Enum)


def refuse_argument(
    argument: str, problem: str, *, expected: str | None = None, hint: str | None = None
) -> ConfigError:
    """Make the error that says what is wrong with the argument of a name."""
    return ConfigError([Problem(problem, argument, argument=True)], expected=expected, hint=hint)


def show_value(given: object) -> str:
    """Write a value for a message: put a text in quotes, and cut what is too long."""
    text = repr(given) if isinstance(given, str) else str(given)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


def check_list(argument: str, given: object, of: str, *, texts: bool = False) -> None:
    """Refuse a value that is no list; a text or a mapping, too, which would be taken letter by letter or key by key.

    Args:
        argument: Name of the argument.
        given: Its value; an iterator is not used up.
        of: What the list should hold, such as ``names``.
        texts: Whether the list should hold texts; if a single text is given, the message then shows it in a list.
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
    """Read a list whose elements are of these kinds; see `check_list` for the other arguments."""
    check_list(argument, given, of, texts=str in kinds)
    elements = tuple(given)
    for each in elements:
        if not isinstance(each, kinds):
            raise refuse_argument(argument, f"{show_value(each)} is in the list", expected=f"a list of {of}")
    return elements


def check_mapping(argument: str, given: object, example: str) -> None:
    """Refuse a value that does not map keys to values; `example` shows what is right."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise refuse_argument(argument, f"got {show_value(given)}", expected=f"a mapping, such as {example}")


def is_whole(given: object) -> bool:
    """Say whether a value is a whole number; True and False are not."""
    return isinstance(given, Integral) and not isinstance(given, bool)


def check_whole_number(argument: str, given: Any, *, least: int, most: int | None = None) -> None:
    """Refuse a value that is not a whole number from `least` to `most`; None for no upper bound."""
    whole = is_whole(given)
    if not whole or given < least or (most is not None and given > most):
        bounds = f"{least} or more" if most is None else f"{least} to {most}"
        expected = bounds if whole else f"a whole number, {bounds}"
        raise refuse_argument(argument, f"got {show_value(given)}", expected=expected)


def as_float(given: Any) -> float:
    """Convert a value to a number; return NaN if it is none, for callers that refuse numbers that are not finite.

    Texts, True and False are no numbers here.
    """
    # NumPy's truth values are not of Python's type.
    if isinstance(given, bool | str | bytes) or str(getattr(given, "dtype", "")) == "bool":
        return math.nan
    try:
        return float(given)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def read_path(argument: str, given: Any) -> Path:
    """Read the path of a file or a directory."""
    path = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if not isinstance(path, str):
        raise refuse_argument(argument, f"got {show_value(given)}", expected="a path, as text or a Path")
    try:
        os.lstat(path)
    except (OSError, ValueError) as error:
        # Python itself refuses a name with a zero byte, by a `ValueError`.
        if not isinstance(error, OSError) or error.errno == errno.ENAMETOOLONG:
            raise ConfigError([Problem("no file can have this name", path=Path(path))]) from error
    return Path(path)


def read_word(argument: str, given: str, words: type[_Word]) -> _Word:
    """Find the member of an enumeration that a word stands for."""
    try:
        return words(given)
    except ValueError:
        meant = suggest(given, [each.value for each in words])
        raise refuse_argument(argument, f"{given!r}{meant}") from None
