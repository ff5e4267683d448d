"""Requests of clients: an operation with its fields, which are checked as they are used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from throwcollect.errors import ConfigError, ThrowcollectError

COMPRESSIONS = ("none", "cbor", "cbor-raw")
"""Encodings of messages to clients; if the subscriptions of a client differ, the one that comes last here is used."""

RequestId = str | int | None
"""The id that a client has given a request; None if it has given none."""


@dataclass(frozen=True)
class Form:
    """How something is sent to a client.

    Attributes:
        compression: ``none`` is JSON; all others are CBOR.
        fragment_size: Characters in each part of a text frame; 0 leaves frames whole.
    """

    compression: str = "none"
    fragment_size: int = 0


class Fields:
    """Fields by name, as a client gives them; error messages begin with ``what``, which the fields belong to."""

    def __init__(self, fields: Mapping[Any, Any], what: str) -> None:
        self._fields = fields
        self._what = what

    def text(self, name: str) -> str:
        """A text that has to be there."""
        value = self._fields.get(name)
        if not isinstance(value, str):
            raise self._wrong(name, "a text", value)
        return value

    def text_or(self, name: str, default: str) -> str:
        """A text that may be left out."""
        return default if self._fields.get(name) is None else self.text(name)

    def natural_or(self, name: str, default: int) -> int:
        """A number from 0 on, which may be left out."""
        value = self._fields.get(name)
        if value is None:
            return default
        # Numbers of JavaScript are floats, which represent whole numbers exactly up to here. In Python, bools are ints.
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 1 << 53:
            raise self._wrong(name, "a number from 0 on", value)
        return int(value)

    def seconds_or(self, name: str, default: float) -> float:
        """A time [s] above 0, which may be left out."""
        value = self._fields.get(name)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            raise self._wrong(name, "a time above 0 in seconds", value)
        return float(value)

    def flag(self, name: str, *, default: bool = False) -> bool:
        """A truth value, which may be left out."""
        value = self._fields.get(name)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self._wrong(name, "true or false", value)
        return value

    def any(self, name: str) -> Any:
        """A field as it is; None if it was left out."""
        return self._fields.get(name)

    def _wrong(self, name: str, what: str, value: object) -> ConfigError:
        got = "nothing" if value is None else f"{value!r:.80}"
        return ConfigError(f"{self._what}: {name} should be {what}, got {got}")


class BridgeRequest(Fields):
    """One operation of the protocol.

    Attributes:
        op: The operation.
        id: The id that the client has given it; None if it has given none.

    Raises:
        ConfigError: If the fields name no operation.
    """

    def __init__(self, fields: Mapping[Any, Any]) -> None:
        super().__init__(fields, "frame")
        self.op = self.text("op")
        self._what = self.op
        given = fields.get("id")
        self.id: RequestId = given if isinstance(given, str | int) else None

    def form(self) -> Form:
        """How the client wants answers and messages to be sent."""
        compression = self.text_or("compression", "none")
        if compression not in COMPRESSIONS:
            raise ConfigError(f"{self.op}: no compression {compression}", expected="none, cbor or cbor-raw")
        return Form(compression, self.natural_or("fragment_size", 0))


def sentence(error: ThrowcollectError) -> str:
    """Put an error into one line: what is wrong, and what would be right."""
    return "; ".join(line.strip() for line in str(error).splitlines())
