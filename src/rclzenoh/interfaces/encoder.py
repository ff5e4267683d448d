"""Writes, for one structure, a Python function that serialises it to CDR.

The wire format is plain CDR, little endian, as Fast-CDR writes it for ROS 2: four bytes ``00 01 00 00``, then the body,
in which each primitive is aligned to its size, counted from the body's first byte.

What makes the functions fast: nested structures are written inline; neighbouring primitives go through one `struct`
call with the padding in its format; arrays are copied as they lie in memory; the bytes of a list of strings, which are
joint names as a rule, are remembered.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any

from rclzenoh.interfaces.catalog import Field, structure
from rclzenoh.interfaces.layout import CODES, Alignment
from rclzenoh.interfaces.message import DTYPES, Message, is_numbers

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation header of little-endian plain CDR."""

_PADDING = tuple(bytes(count) for count in range(8))


@cache
def encoder(name: str) -> Callable[[Message], bytearray]:
    """Function that serialises messages of one type.

    Args:
        name: Full name of the structure.

    Returns:
        The function. It raises AttributeError, TypeError, ValueError, OverflowError or ``struct.error`` when a field
        holds something that is not of its type.
    """
    writer = _Writer()
    writer.structure(name, "message", 1)
    writer.flush(1)
    source = "\n".join(["def encode(message):", " out = bytearray(HEADER)", *writer.lines, " return out"])
    exec(source, writer.namespace)  # noqa: S102 - names come from the definitions, nothing from outside
    encode: Callable[[Message], bytearray] = writer.namespace["encode"]
    return encode


@lru_cache(maxsize=512)
def _strings(values: tuple[str, ...]) -> bytes:
    """A sequence of strings without its count, from a position that is a multiple of four."""
    out = bytearray()
    for value in values:
        text = value.encode() + b"\x00"
        out += _PADDING[-len(out) & 3] + struct.pack("<I", len(text)) + text
    return bytes(out)


def _check_length(values: Sequence[Any], field: Field) -> None:
    if field.length is not None and len(values) != field.length:
        raise ValueError(f"{field.name}: expected {field.length} elements, got {len(values)}")
    if field.bound is not None and len(values) > field.bound:
        raise ValueError(f"{field.name}: expected at most {field.bound}, got {len(values)}")


class _Writer:
    """Source lines under construction, and what is known of the position at the end of them."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.namespace: dict[str, Any] = {"HEADER": HEADER, "PADDING": _PADDING, "strings": _strings}
        self.namespace["check_length"] = _check_length
        self.at = Alignment(8, 0)
        self.run_format = ""
        self.run_values: list[str] = []
        self.names = 0

    def fresh(self, prefix: str) -> str:
        self.names += 1
        return f"{prefix}{self.names}"

    def line(self, depth: int, text: str) -> None:
        self.lines.append(" " * depth + text)

    def scalar(self, primitive: str, value: str, depth: int) -> None:
        size = struct.calcsize(CODES[primitive])
        padding = self.at.padding(size)
        if padding is None:
            self.align(size, depth)
            padding = 0
        self.run_format += "x" * padding + CODES[primitive]
        self.run_values.append(value)
        self.at = self.at.after(padding + size)

    def flush(self, depth: int) -> None:
        """Emit the primitives collected so far."""
        if self.run_values:
            pack = self.fresh("pack")
            self.namespace[pack] = struct.Struct("<" + self.run_format).pack
            self.line(depth, f"out += {pack}({', '.join(self.run_values)})")
        self.run_format, self.run_values = "", []

    def align(self, size: int, depth: int) -> None:
        """Pad to a multiple of ``size``, at run time if the position is not known well enough."""
        padding = self.at.padding(size)
        self.flush(depth)
        if padding is None:
            # The header in front of the body is a multiple of four, but not of eight.
            position = "len(out)" if size < 8 else "4 - len(out)"
            self.line(depth, f"out += PADDING[{'-' if size < 8 else ''}{position} & {size - 1}]")
            self.at = Alignment(size, 0)
        elif padding:
            self.line(depth, f"out += PADDING[{padding}]")
            self.at = self.at.after(padding)

    def structure(self, name: str, message: str, depth: int) -> None:
        fields = structure(name).fields
        if not fields:
            self.scalar("uint8", "0", depth)
        for field in fields:
            self.field(field, f"{message}.{'_' if is_numbers(field) else ''}{field.name}", depth)

    def field(self, field: Field, value: str, depth: int) -> None:
        if is_numbers(field):
            self.numbers(field, value, depth)
        elif field.length is None and not field.sequence:
            self.element(field, value, depth, bounded=field.bound is not None)
        else:
            self.elements(field, value, depth)

    def element(self, field: Field, value: str, depth: int, *, bounded: bool = False) -> None:
        if field.nested:
            self.structure(field.type, value, depth)
        elif field.type == "string":
            if bounded:
                self.check(field, value, depth)
            text = self.fresh("text")
            self.line(depth, f'{text} = {value}.encode() + b"\\0"')
            self.scalar("uint32", f"len({text})", depth)
            self.flush(depth)
            self.line(depth, f"out += {text}")
            self.at = Alignment(1, 0)
        else:
            self.scalar(field.type, value, depth)

    def check(self, field: Field, value: str, depth: int) -> None:
        name = self.fresh("field")
        self.namespace[name] = field
        self.line(depth, f"check_length({value}, {name})")

    def numbers(self, field: Field, value: str, depth: int) -> None:
        size = DTYPES[field.type].itemsize
        array = self.fresh("array")
        self.line(depth, f"{array} = {value}")
        if field.length is not None:
            self.align(size, depth)
            self.line(depth, f"out += {array}.data")
            self.at = self.at.after(size * field.length)
            return
        self.scalar("uint32", f"{array}.size", depth)
        self.flush(depth)
        empty = self.at
        self.line(depth, f"if {array}.size:")
        self.align(size, depth + 1)
        self.line(depth + 1, f"out += {array}.data")
        self.at = empty.either(Alignment(size, 0))

    def elements(self, field: Field, value: str, depth: int) -> None:
        """A sequence or array of strings or structures."""
        values = self.fresh("values")
        self.line(depth, f"{values} = {value}")
        if field.bound is not None or field.length is not None:
            self.check(field, values, depth)
        if field.length is None:
            self.scalar("uint32", f"len({values})", depth)
        if field.type == "string":
            self.align(4, depth)
            self.flush(depth)
            self.line(depth, f"out += strings(tuple({values}))")
            self.at = Alignment(1, 0)
            return
        self.flush(depth)
        item = self.fresh("item")
        self.line(depth, f"for {item} in {values}:")
        before, lines = self.at, len(self.lines)
        while True:
            # The body must hold for the first element and for those after it, so it is written until that is so.
            self.at = before
            self.element(field, item, depth + 1)
            self.flush(depth + 1)
            entry = before.either(self.at)
            if entry == before:
                break
            before = entry
            del self.lines[lines:]
        self.at = before
