"""The common part of the CDR encoder and decoder: positions in the body, and the writing of functions."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from typing import Any

from rclzenoh.interfaces.catalog import Field
from rclzenoh.interfaces.message import is_numbers

CODES = {
    "bool": "?",
    "byte": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Format character of `struct` for each primitive."""


class FunctionWriter(ABC):
    """Writes the source of a function that goes through one structure, field by field; `namespace` has its globals.

    The encoder and the decoder say which lines each kind of field needs. An operand is the expression that has the
    value of a field, or the target that gets it.
    """

    def __init__(self, **namespace: Any) -> None:
        self.lines: list[str] = []
        self.namespace = namespace
        # The position in the body is a multiple of the first number plus the second.
        self.base, self.offset = 8, 0
        # Neighbouring primitives, collected for one call of `struct`.
        self.run_format = ""
        self.run_operands: list[str] = []
        self._names = 0

    @abstractmethod
    def run(self, depth: int) -> None:
        """Go through the collected primitives."""

    @abstractmethod
    def pad(self, size: int, padding: int | None) -> str:
        """The line that goes on to a multiple of ``size``; ``padding`` is the number of bytes, None if not known."""

    @abstractmethod
    def element(self, field: Field, operand: str, depth: int) -> None:
        """Go through a field that is neither sequence nor array, or through one element of it."""

    @abstractmethod
    def numbers(self, field: Field, operand: str, depth: int) -> None:
        """Go through a sequence or array of numbers."""

    @abstractmethod
    def elements(self, field: Field, operand: str, depth: int) -> None:
        """Go through a sequence or array of strings or structures."""

    def name(self, prefix: str) -> str:
        """A new name for a local variable, or for something in the namespace."""
        self._names += 1
        return f"{prefix}{self._names}"

    def line(self, depth: int, text: str) -> None:
        """Add a line."""
        self.lines.append(" " * depth + text)

    def field(self, field: Field, structure: str, depth: int) -> None:
        """Go through a field of a structure."""
        if is_numbers(field):
            self.numbers(field, f"{structure}._{field.name}", depth)
        elif field.length is None and not field.sequence:
            self.element(field, f"{structure}.{field.name}", depth)
        else:
            self.elements(field, f"{structure}.{field.name}", depth)

    def scalar(self, primitive: str, operand: str, depth: int) -> None:
        """Collect a primitive."""
        size = struct.calcsize(CODES[primitive])
        if self.base < size:
            self.align(size, depth)
        padding = -self.offset % size
        self.run_format += "x" * padding + CODES[primitive]
        self.run_operands.append(operand)
        self.offset += padding + size

    def flush(self, depth: int) -> None:
        """Go through the primitives that were collected so far."""
        if self.run_operands:
            self.run(depth)
        self.run_format, self.run_operands = "", []

    def align(self, size: int, depth: int) -> None:
        """Flush and go on to a multiple of a size, at run time if the position is not known well enough."""
        self.flush(depth)
        if self.base < size:
            self.line(depth, self.pad(size, None))
            self.base, self.offset = size, 0
        elif padding := -self.offset % size:
            self.line(depth, self.pad(size, padding))
            self.offset += padding

    def lose_position(self) -> None:
        """Note that nothing is known of the position any more, as after a string."""
        self.base, self.offset = 1, 0

    def loop_body(self, field: Field, item: str, depth: int) -> None:
        """Write the body of a loop over elements, which may begin anywhere."""
        self.lose_position()
        self.element(field, item, depth)
        self.flush(depth)
        self.lose_position()
