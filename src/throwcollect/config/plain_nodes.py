"""Parses YAML as `loader.dump_yaml` writes it in a tenth of the time that ruamel.yaml takes.

Every dataset has such a text, which each command that opens the dataset parses anew. Of the nodes, `document.Document`
uses tags, values and lines, so only these are as the library makes them.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from ruamel.yaml.error import StringMark, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

_TAG = "tag:yaml.org,2002:"
_LINE = re.compile("( *)([A-Za-z_][A-Za-z0-9_./-]*):(?: (.+))?")
_LEVEL = 2
_MOST_LEVELS = 20
_MOST_CHARACTERS = 50_000
"""More may be too large, which the library finds out as it goes on."""
_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n"})
"""Plain words that are other values than text, in one version of YAML or another."""
_SCALARS = (
    (re.compile("true|false"), f"{_TAG}bool"),
    (re.compile("null"), f"{_TAG}null"),
    (re.compile("-?(0|[1-9][0-9]*)"), f"{_TAG}int"),
    (re.compile(r"-?(0|[1-9][0-9]*)\.[0-9]+"), f"{_TAG}float"),
)
_WORD = re.compile("[A-Za-z_][A-Za-z0-9_./-]*")
_IN_BRACKETS = re.compile(r"[\[{\"0-9-][^&*!#|>%@`\t]*")
"""Lists, mappings, quoted text and other numbers in one line, without what refers to something outside of it."""


class _Unusual(Exception):
    """The text is left to the library."""


def compose_plain(text: str, compose: Callable[[str], Node | None]) -> MappingNode | None:
    """Parse a text; None if it is not as `loader.dump_yaml` writes them.

    Args:
        text: A whole text.
        compose: Parses by the library what stands in one line and is no plain word, number or truth value.
    """
    if len(text) > _MOST_CHARACTERS or not text.endswith("\n"):
        return None
    lines = [_LINE.fullmatch(line) for line in text[:-1].split("\n")]
    if not all(lines):
        return None
    try:
        node, end = _mapping([(len(line[1]), line[2], line[3]) for line in lines if line], 0, 0, compose)
    except (_Unusual, YAMLError):
        return None
    return node if end == len(lines) else None


def _mapping(
    lines: list[tuple[int, str, str | None]], at: int, indent: int, compose: Callable[[str], Node | None]
) -> tuple[MappingNode, int]:
    """Parse the mapping that begins with a line; returns the number of the line behind it, too.

    Raises:
        _Unusual: If something in it is left to the library.
        YAMLError: If something in it is no YAML.
    """
    if at == len(lines) or lines[at][0] != indent or indent > _MOST_LEVELS * _LEVEL:
        raise _Unusual
    begun, pairs = at, []
    while at < len(lines) and lines[at][0] == indent:
        _, key, value = lines[at]
        if key.lower() in _WORDS:
            raise _Unusual
        value_node: Node
        key_node = ScalarNode(f"{_TAG}str", key, _mark(at))
        if value is None:
            value_node, at = _mapping(lines, at + 1, indent + _LEVEL, compose)
        else:
            value_node, at = _value(value, at, compose), at + 1
        pairs.append((key_node, value_node))
    return MappingNode(f"{_TAG}map", pairs, _mark(begun)), at


def _value(text: str, line: int, compose: Callable[[str], Node | None]) -> Node:
    for pattern, tag in _SCALARS:
        if pattern.fullmatch(text):
            return ScalarNode(tag, text, _mark(line))
    if _WORD.fullmatch(text) and text.lower() not in _WORDS:
        return ScalarNode(f"{_TAG}str", text, _mark(line))
    if not _IN_BRACKETS.fullmatch(text):
        raise _Unusual
    # A value alone could be what is no value behind a key.
    whole = compose(f"key: {text}\n")
    if not isinstance(whole, MappingNode) or len(whole.value) != 1:
        raise _Unusual
    return _place(whole.value[0][1], line)


def _place(node: Node, line: int) -> Node:
    """Copy a node, and all that it holds, to a line."""
    if isinstance(node, MappingNode):
        pairs = [(_place(key, line), _place(value, line)) for key, value in node.value]
        return MappingNode(node.tag, pairs, _mark(line))
    if isinstance(node, SequenceNode):
        return SequenceNode(node.tag, [_place(item, line) for item in node.value], _mark(line))
    return ScalarNode(node.tag, node.value, _mark(line))


def _mark(line: int) -> StringMark:
    return StringMark(None, 0, line, 0, None, 0)
