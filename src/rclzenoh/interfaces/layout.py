"""The common part of the CDR encoder and decoder: positions in the body, and the writing of functions."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import gcd
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


@dataclass(frozen=True)
class Alignment:
    """A position in the body of which only the remainder is known: ``position = remainder (mod modulus)``."""

    modulus: int
    remainder: int

    def padding(self, size: int) -> int | None:
        """Bytes up to the next multiple of ``size``; None if the position is not known well enough."""
        return -self.remainder % size if self.modulus % size == 0 else None

    def after(self, count: int) -> Alignment:
        """The position ``count`` bytes on."""
        return Alignment(self.modulus, (self.remainder + count) % self.modulus)

    def either(self, other: Alignment) -> Alignment:
        """The knowledge of a position that may be either this one or the other one."""
        modulus = gcd(self.modulus, other.modulus, self.remainder - other.remainder)
        return Alignment(modulus, self.remainder % modulus)


class FunctionWriter(ABC):
    """Writes the source of a function that goes through one structure, field by field; `namespace` has its globals.

    The encoder and the decoder say which lines each kind of field needs. An operand is the expression that has the
    value of a field, or the target that gets it.
    """

    def __init__(self, **namespace: Any) -> None:
        self.lines: list[str] = []
        self.namespace = namespace
        self.at = Alignment(8, 0)
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
        padding = self.at.padding(size)
        if padding is None:
            self.align(size, depth)
            padding = 0
        self.run_format += "x" * padding + CODES[primitive]
        self.run_operands.append(operand)
        self.at = self.at.after(padding + size)

    def flush(self, depth: int) -> None:
        """Go through the primitives that were collected so far."""
        if self.run_operands:
            self.run(depth)
        self.run_format, self.run_operands = "", []

    def align(self, size: int, depth: int) -> None:
        """Flush and go on to a multiple of a size, at run time if the position is not known well enough."""
        padding = self.at.padding(size)
        self.flush(depth)
        if padding != 0:
            self.line(depth, self.pad(size, padding))
        self.at = Alignment(size, 0) if padding is None else self.at.after(padding)

    def loop_body(self, field: Field, item: str, depth: int) -> None:
        """Write the body of a loop over elements.

        The code must be right for the first element and for later ones, which may begin at other positions. So it is
        written again, with less knowledge of the position, until it is right for all elements.
        """
        entry, first_line = self.at, len(self.lines)
        while True:
            self.at = entry
            self.element(field, item, depth)
            self.flush(depth)
            self.at = entry.either(self.at)
            if self.at == entry:
                return
            entry = self.at
            del self.lines[first_line:]
