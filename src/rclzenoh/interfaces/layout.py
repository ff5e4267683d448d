"""What the CDR encoder and decoder share: sizes of primitives, and what is known of a position."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

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
        """Bytes up to the next multiple of ``size``; None if that depends on what is not known."""
        return -self.remainder % size if self.modulus % size == 0 else None

    def after(self, count: int) -> Alignment:
        """The position ``count`` bytes on."""
        return Alignment(self.modulus, (self.remainder + count) % self.modulus)

    def either(self, other: Alignment) -> Alignment:
        """What holds whichever of two positions was reached."""
        modulus = gcd(self.modulus, other.modulus, self.remainder - other.remainder)
        return Alignment(modulus, self.remainder % modulus)
