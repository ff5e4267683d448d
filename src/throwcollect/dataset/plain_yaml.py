"""Writes and reads YAML of usual values as ruamel.yaml does, in a fortieth of its time.

Each file of a collection holds the metadata of a bag, so that small collections took a tenth of their time to write
them. What is unusual is left to the library, so there is no other text or value than its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_LONGEST_KEY = 100
_DIGITS = re.compile("[0-9]+")
_INTEGER = re.compile("-?[0-9]+")
_PLAIN = re.compile("[A-Za-z/][A-Za-z0-9_/.-]*")
_DIGEST = re.compile("(?=.*[acdf])[0-9a-f]{64}")
"""Of digits, `e` and `b` alone, it may be a number."""
_WORDS = frozenset({"null", "true", "false", "yes", "no", "on", "off", "y", "n"})
"""Plain words that are other values than text, in one version of YAML or another."""
_NO_TEXT = {"true": True, "false": False}


class _Unusual(Exception):
    """Something is left to the library."""


def write(data: Mapping[str, Any]) -> str | None:
    """Write a mapping of what JSON knows in block style; None if a key or a value is unusual."""
    try:
        return "".join(f"{line}\n" for line in _lines(data, ""))
    except _Unusual:
        return None


def read(text: str) -> dict[str, Any] | None:
    """Read what `write` has written; None if it is any other text."""
    lines = text.splitlines()
    try:
        data, end = _read_mapping(lines, 0, "")
    except (_Unusual, RecursionError, ValueError):
        return None
    # Whatever was misunderstood is written otherwise.
    return data if end == len(lines) and data and write(data) == text else None


def _lines(data: Mapping[str, Any], indent: str) -> Iterator[str]:
    """Write the lines of a mapping.

    Raises:
        _Unusual: If a key or a value is unusual.
    """
    for key, value in data.items():
        # A longer key would stand on a line of its own, behind a question mark.
        if len(key) > _LONGEST_KEY:
            raise _Unusual
        if value and isinstance(value, dict):
            yield f"{indent}{_scalar(key)}:"
            yield from _lines(value, indent + "  ")
        elif value and isinstance(value, list):
            yield f"{indent}{_scalar(key)}:"
            yield from _item_lines(value, indent)
        else:
            yield f"{indent}{_scalar(key)}: {_scalar(value)}"


def _item_lines(values: Sequence[Any], indent: str) -> Iterator[str]:
    for value in values:
        if value and isinstance(value, dict):
            # The first key stands behind the dash, the others below it.
            first, *others = _lines(value, indent + "  ")
            yield f"{indent}- {first[len(indent) + 2 :]}"
            yield from others
        else:
            yield f"{indent}- {_scalar(value)}"


def _scalar(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, (dict, list)) and not value:
        return "{}" if isinstance(value, dict) else "[]"
    if isinstance(value, str):
        if not value or _DIGITS.fullmatch(value):
            return f"'{value}'"
        if (_PLAIN.fullmatch(value) and value.lower() not in _WORDS) or _DIGEST.fullmatch(value):
            return value
    raise _Unusual


def _read_mapping(lines: list[str], at: int, indent: str) -> tuple[dict[str, Any], int]:
    """Read the mapping that begins with a line; returns the number of the line behind it, too."""
    data: dict[str, Any] = {}
    while at < len(lines) and lines[at].startswith(indent) and lines[at][len(indent) :][:1] not in ("", " ", "-"):
        key, _, rest = lines[at][len(indent) :].partition(":")
        at += 1
        if rest:
            data[key] = _value(rest[1:])
        elif at < len(lines) and lines[at].startswith(f"{indent}- "):
            data[key], at = _read_items(lines, at, indent)
        else:
            data[key], at = _read_mapping(lines, at, indent + "  ")
    return data, at


def _read_items(lines: list[str], at: int, indent: str) -> tuple[list[Any], int]:
    values: list[Any] = []
    while at < len(lines) and lines[at].startswith(f"{indent}- "):
        content = lines[at][len(indent) + 2 :]
        begun = at
        if ":" in content:
            # Without the dash, it is the first line of a mapping.
            lines[at] = f"{indent}  {content}"
            value, at = _read_mapping(lines, at, indent + "  ")
            if at == begun:
                raise _Unusual
        else:
            value, at = _value(content), at + 1
        values.append(value)
    return values, at


def _value(text: str) -> Any:
    if text in _NO_TEXT:
        return _NO_TEXT[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if text == "{}":
        return {}
    if text == "[]":
        return []
    return text[1:-1] if text[:1] == "'" else text
