"""Writes, for one structure, a Python function that serialises it to CDR.

The wire format is plain CDR, little endian, as Fast-CDR writes it for ROS 2: four bytes ``00 01 00 00``, then the body,
in which each primitive is aligned to its size, counted from the body's first byte.

The functions are fast because nested structures are written inline, neighbouring primitives go through one `struct`
call with the padding in its format, arrays are copied as they lie in memory, and the bytes of a list of strings (joint
names as a rule) are remembered.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np

from rclzenoh.interfaces.catalog import Field, structure
from rclzenoh.interfaces.layout import FunctionWriter
from rclzenoh.interfaces.message import DTYPES, Message

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation header of little-endian plain CDR."""

_PADDING = tuple(bytes(count) for count in range(8))


@cache
def encoder(name: str) -> Callable[[Message], bytearray]:
    """Function that serialises messages of one type.

    It raises AttributeError, TypeError, ValueError, OverflowError or ``struct.error`` if a value is not of its field's
    type.
    """
    writer = _Writer(
        HEADER=HEADER,
        PADDING=_PADDING,
        strings=_write_strings,
        check_length=_check_length,
        check_bool=_check_bool,
        check_list=_check_list,
    )
    writer.structure(name, "message", 1)
    writer.flush(1)
    source = "\n".join(["def encode(message):", " out = bytearray(HEADER)", *writer.lines, " return out"])
    exec(source, writer.namespace)  # noqa: S102 - names come from the definitions, nothing from outside
    encode: Callable[[Message], bytearray] = writer.namespace["encode"]
    return encode


def serialize(message: Message) -> bytes:
    """Little-endian CDR of a message, with the encapsulation header."""
    try:
        return bytes(encoder(message.TYPE)(message))
    except (AttributeError, TypeError) as error:
        raise TypeError(f"{message.TYPE} cannot be serialised: {error}") from error
    except (struct.error, OverflowError, ValueError) as error:
        raise ValueError(f"{message.TYPE} cannot be serialised: {error}") from error


@lru_cache(maxsize=512)
def _write_strings(values: tuple[str, ...]) -> bytes:
    """A sequence of strings without its count, from a position that is a multiple of four."""
    out = bytearray()
    for value in values:
        text = value.encode() + b"\x00"
        out += _PADDING[-len(out) & 3] + struct.pack("<I", len(text)) + text
    return bytes(out)


def _check_length(values: Sequence[Any], field: Field) -> None:
    if field.length is not None and len(values) != field.length:
        raise ValueError(f"{field.name}: expected {field.length} elements, got {len(values)}")
    if field.bound is None:
        return
    # In a fixed array, the bound applies to each of its strings.
    for bounded in (values,) if field.length is None else values:
        if len(bounded) > field.bound:
            raise ValueError(f"{field.name}: expected at most {field.bound}, got {len(bounded)}")


def _check_bool(value: object) -> object:
    """Refuse what is no truth value, as `struct` takes anything for one."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"expected a bool, got {value!r}")
    return value


def _check_list(values: Sequence[str]) -> tuple[str, ...]:
    """Refuse a single string in place of a sequence, as its letters are strings, too."""
    if isinstance(values, str):
        raise TypeError(f"expected a sequence of strings, got {values!r}")
    return tuple(values)


class _Writer(FunctionWriter):
    """Writes a function that appends to ``out``; operands are expressions of values."""

    def run(self, depth: int) -> None:
        pack = self.name("pack")
        self.namespace[pack] = struct.Struct("<" + self.run_format).pack
        self.line(depth, f"out += {pack}({', '.join(self.run_operands)})")

    def pad(self, size: int, padding: int | None) -> str:
        # The length of the header before the body is a multiple of four, but not of eight.
        at_run_time = f"{'-len(out)' if size < 8 else '4 - len(out)'} & {size - 1}"
        return f"out += PADDING[{at_run_time if padding is None else padding}]"

    def structure(self, name: str, operand: str, depth: int) -> None:
        fields = structure(name).fields
        if not fields:
            self.scalar("uint8", "0", depth)
        for field in fields:
            self.field(field, operand, depth)

    def element(self, field: Field, operand: str, depth: int) -> None:
        if field.nested:
            self.structure(field.type, operand, depth)
        elif field.type == "string":
            if field.bound is not None:
                self.check(field, operand, depth)
            text = self.name("text")
            self.line(depth, f'{text} = {operand}.encode() + b"\\0"')
            self.scalar("uint32", f"len({text})", depth)
            self.flush(depth)
            self.line(depth, f"out += {text}")
            self.lose_position()
        else:
            self.scalar(field.type, f"check_bool({operand})" if field.type == "bool" else operand, depth)

    def check(self, field: Field, operand: str, depth: int) -> None:
        name = self.name("field")
        self.namespace[name] = field
        self.line(depth, f"check_length({operand}, {name})")

    def numbers(self, field: Field, operand: str, depth: int) -> None:
        size = DTYPES[field.type].itemsize
        array = self.name("array")
        self.line(depth, f"{array} = {operand}")
        if field.length is not None:
            self.align(size, depth)
            # The memory can be copied as it is, because `as_numbers` has made it contiguous and of the field's type.
            self.line(depth, f"out += {array}.data")
            self.offset += size * field.length
            return
        self.scalar("uint32", f"{array}.size", depth)
        self.flush(depth)
        self.line(depth, f"if {array}.size:")
        self.align(size, depth + 1)
        self.line(depth + 1, f"out += {array}.data")
        # An empty sequence ends with its count of four bytes.
        self.base, self.offset = min(size, 4), 0

    def elements(self, field: Field, operand: str, depth: int) -> None:
        values = self.name("values")
        self.line(depth, f"{values} = {operand}")
        if field.bound is not None or field.length is not None:
            self.check(field, values, depth)
        if field.length is None:
            self.scalar("uint32", f"len({values})", depth)
        if field.type == "string":
            self.align(4, depth)
            self.line(depth, f"out += strings(check_list({values}))")
            self.lose_position()
            return
        self.flush(depth)
        item = self.name("item")
        self.line(depth, f"for {item} in {values}:")
        self.loop_body(field, item, depth + 1)
