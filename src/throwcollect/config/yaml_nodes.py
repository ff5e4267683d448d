"""From YAML text to nodes, within bounds: a text that no configuration looks like is refused before it costs time."""

from __future__ import annotations

from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import Node
from ruamel.yaml.scanner import Scanner, ScannerError

MOST_LEVELS = 50
"""Levels of values inside values."""
MOST_VALUES = 30_000
"""More than 500 weights for each of 32 joints; a text with so many takes a few seconds to be looked at."""

_MOST_TOKENS = 5 * MOST_VALUES
"""A key and its value are four."""


class _Scanner(Scanner):
    """Cuts a text into tokens, and refuses what is nested too deeply or has too many of them."""

    def fetch_more_tokens(self) -> Any:
        if self.tokens_taken + len(self.tokens) > _MOST_TOKENS:
            self._refuse(f"holds more than {MOST_VALUES} values")
        if self.flow_level + len(self.indents) > MOST_LEVELS:
            self._refuse("values are nested too deeply")
        return super().fetch_more_tokens()

    def _refuse(self, reason: str) -> None:
        raise ScannerError(None, None, reason, self.reader.get_mark())


def compose(text: str) -> Node | None:
    """The node of a text; None if there is nothing in it.

    Raises:
        YAMLError: If it is no YAML, or too much of it.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Scanner = _Scanner
    node: Node | None = yaml.compose(text)
    return node


def reason(error: YAMLError) -> str:
    """What is wrong with a text, in words."""
    if isinstance(error, MarkedYAMLError):
        return ", ".join(filter(None, [error.problem, error.context]))
    return str(error).partition("\n")[0]


def line(error: YAMLError) -> int | None:
    """Line in which it is wrong, counted from 1; None if that is not known."""
    mark = (error.problem_mark or error.context_mark) if isinstance(error, MarkedYAMLError) else None
    return mark.line + 1 if mark else None
