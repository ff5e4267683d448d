"""Parses YAML text, and refuses a text that is too large for a configuration before it costs time."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import Node
from ruamel.yaml.scanner import Scanner, ScannerError

MOST_LEVELS = 50
"""Most levels of values inside values."""
MOST_VALUES = 30_000
"""Most values: more than 500 weights for each of 32 joints, which take a few seconds to parse."""

_MOST_TOKENS = 5 * MOST_VALUES
"""Most tokens: a key and its value are four."""


class _Scanner(Scanner):
    """Cuts a text into tokens, and refuses one that has too many of them or is nested too deeply."""

    def fetch_more_tokens(self) -> Any:
        if self.tokens_taken + len(self.tokens) > _MOST_TOKENS:
            self._refuse(f"holds more than {MOST_VALUES} values")
        if self.flow_level + len(self.indents) > MOST_LEVELS:
            self._refuse("values are nested too deeply")
        return super().fetch_more_tokens()

    def scan_flow_scalar_non_spaces(self, double: Any, start_mark: Any) -> Any:
        # The digits after \U may name no character, and those after \u half of a surrogate pair, which no file can
        # hold.
        try:
            parts = super().scan_flow_scalar_non_spaces(double, start_mark)
            "".join(parts).encode()
        except (ValueError, OverflowError):
            self._refuse("an escaped character does not exist in Unicode")
        return parts

    def _refuse(self, reason: str) -> None:
        raise ScannerError(None, None, reason, self.reader.get_mark())


@lru_cache(maxsize=8)
def compose(text: str) -> Node | None:
    """Parse a text into a node, which nobody may change; None if the text is empty.

    It remembers the last texts, because parsing takes 10 ms, and one command reads the configuration of a dataset
    several times: for the plan, for its tables, for each file that it verifies.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Scanner = _Scanner
    node: Node | None = yaml.compose(text)
    return node


def reason(error: YAMLError) -> str:
    """Say what is wrong with a text."""
    if isinstance(error, MarkedYAMLError):
        return ", ".join(filter(None, [error.problem, error.context]))
    return str(error).partition("\n")[0]


def line(error: YAMLError) -> int | None:
    """Find the line of the error, counted from 1; None if it is unknown."""
    mark = (error.problem_mark or error.context_mark) if isinstance(error, MarkedYAMLError) else None
    return mark.line + 1 if mark else None
