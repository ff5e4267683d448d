"""Writes, for one structure, a Python function that makes messages from CDR.

The body is copied once into memory of its own, in which number sequences of the message are views that may be changed.
A sequence of numbers that claims to be longer than the data ends up beyond it, which is noticed when more is read or at
the end. Other sequences are made element by element, so their claim is compared with the data before the first one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np

from rclzenoh.interfaces.catalog import Field, structure
from rclzenoh.interfaces.encoder import HEADER
from rclzenoh.interfaces.layout import FunctionWriter
from rclzenoh.interfaces.message import DTYPES, Message, message_class

_M = TypeVar("_M", bound=Message)
_STRINGS_OF_NOTHING = (b"\x00\x00\x00\x00", ())


@cache
def decoder(name: str) -> Callable[[bytes, bytearray], tuple[Any, int]]:
    """Function that makes messages of one type from their bytes.

    It takes the data with its header and a copy of the body that is padded to a multiple of eight bytes. It returns the
    message and the length of the body that it used, which exceeds the body if data is missing, and raises IndexError,
    ValueError or ``struct.error`` if the data is malformed.
    """
    reader = _Reader()
    reader.structure(name, "message", 1)
    reader.flush(1)
    start = [f" {view} = frombuffer(body, {view}_type)" for view in reader.views]
    source = ["def decode(data, body):", " words = memoryview(body).cast('I')", " at = 0", *start, *reader.lines]
    exec("\n".join([*source, " return message, at"]), reader.namespace)  # noqa: S102 - as in `encoder`
    decode: Callable[[bytes, bytearray], tuple[Any, int]] = reader.namespace["decode"]
    return decode


def deserialize(data: bytes, kind: type[_M]) -> _M:
    """Message from its bytes: little-endian CDR with its encapsulation header.

    The message shares no memory with ``data``, and its number sequences may be changed. Bytes after the message are
    ignored: rmw_serialize gives as many bytes as the message might take, and programs publish all of them.
    """
    name = kind.TYPE
    # Only the first two bytes of the header name the encoding. The others are options (DDSI-RTPS, serialized payload).
    if data[:2] != HEADER[:2] or len(data) < len(HEADER):
        raise ValueError(f"{name}: not little-endian CDR: begins with {bytes(data[:4]).hex(' ') or 'nothing'}")
    size = len(data) - 4
    body = bytearray(data[4:] + bytes(-size & 7))
    try:
        message: _M
        message, end = decoder(name)(data, body)
    except (struct.error, IndexError, ValueError) as error:
        raise ValueError(f"{name}: malformed CDR of {len(data)} bytes: {error}") from error
    if end > size:
        raise ValueError(f"{name}: expected {end + 4} bytes of CDR, got {len(data)}")
    return message


def _read_strings(
    data: bytes, at: int, count: int, memory: list[tuple[bytes, tuple[str, ...]]]
) -> tuple[list[str], int]:
    """Read a sequence of strings after its count, and remember its bytes: joint names are the same every time."""
    start = at - 4
    values = []
    for _ in range(count):
        at = (at + 3) & -4
        (length,) = struct.unpack_from("<I", data, at + 4)
        values.append(data[at + 8 : at + 7 + length].decode())
        at += 4 + length
    known = data[start + 4 : at + 4]
    # If the data is cut off, its bytes are not remembered, because complete data may begin with the same bytes.
    if len(known) == at - start:
        memory[0] = (known, tuple(values))
    return values, at


class _Reader(FunctionWriter):
    """Writes a function that reads at position ``at``; operands are expressions that get the values."""

    def __init__(self) -> None:
        super().__init__(frombuffer=np.frombuffer, new=object.__new__, strings=_read_strings)
        self.views: dict[str, None] = {}

    def run(self, depth: int) -> None:
        if self.run_format == "I":
            self.line(depth, f"{self.run_operands[0]} = words[at >> 2]")
        else:
            unpack = self.name("unpack")
            self.namespace[unpack] = struct.Struct("<" + self.run_format).unpack_from
            self.line(depth, f"{', '.join(self.run_operands)}, = {unpack}(body, at)")
        self.line(depth, f"at += {struct.calcsize('<' + self.run_format)}")

    def pad(self, size: int, padding: int | None) -> str:
        return f"at = (at + {size - 1}) & -{size}" if padding is None else f"at += {padding}"

    def structure(self, name: str, operand: str, depth: int) -> None:
        cls = self.name("class")
        self.namespace[cls] = message_class(name)
        local = operand if operand.isidentifier() else self.name("part")
        self.line(depth, f"{local} = {'' if local == operand else operand + ' = '}new({cls})")
        fields = structure(name).fields
        if not fields:
            self.scalar("uint8", "_", depth)
        for field in fields:
            self.field(field, local, depth)

    def element(self, field: Field, operand: str, depth: int) -> None:
        if field.nested:
            self.structure(field.type, operand, depth)
        elif field.type == "string":
            length = self.name("length")
            self.scalar("uint32", length, depth)
            self.flush(depth)
            # The terminating zero is left out. This also reads a length of 0, with which some writers write an empty
            # string.
            self.line(depth, f"{operand} = data[at + 4 : at + 3 + {length}].decode()")
            self.line(depth, f"at += {length}")
            self.lose_position()
        else:
            self.scalar(field.type, operand, depth)

    def numbers(self, field: Field, operand: str, depth: int) -> None:
        dtype = DTYPES[field.type]
        size, view = dtype.itemsize, f"view_{dtype.name}"
        shift = size.bit_length() - 1
        self.views[view] = None
        self.namespace[f"{view}_type"] = dtype
        if field.length is not None:
            self.align(size, depth)
            self.line(depth, f"{operand} = {view}[at >> {shift} : (at >> {shift}) + {field.length}]")
            self.line(depth, f"at += {size * field.length}")
            self.offset += size * field.length
            return
        count, empty = self.name("count"), self.name("empty")
        self.namespace[empty] = np.zeros(0, dtype)
        self.scalar("uint32", count, depth)
        self.flush(depth)
        self.line(depth, f"if {count}:")
        self.align(size, depth + 1)
        self.line(depth + 1, f"{operand} = {view}[at >> {shift} : (at >> {shift}) + {count}]")
        self.line(depth + 1, f"at += {count} << {shift}" if shift else f"at += {count}")
        self.line(depth, "else:")
        self.line(depth + 1, f"{operand} = {empty}")
        # Padding belongs to the first number and not to the count, so an empty sequence has none.
        self.base, self.offset = min(size, 4), 0

    def elements(self, field: Field, operand: str, depth: int) -> None:
        count = str(field.length)
        if field.length is None:
            count = self.name("count")
            self.scalar("uint32", count, depth)
        self.flush(depth)
        if field.type == "string" and field.length is None:
            self.strings(operand, count, depth)
            return
        values, item = self.name("values"), self.name("item")
        if field.length is None:
            # Every element takes a byte at least.
            self.line(depth, f"if {count} > len(body) - at:")
            self.line(depth + 1, "raise IndexError('a sequence that is longer than the data')")
        self.line(depth, f"{operand} = {values} = []")
        self.line(depth, f"for _ in range({count}):")
        self.loop_body(field, item, depth + 1)
        self.line(depth + 1, f"{values}.append({item})")

    def strings(self, operand: str, count: str, depth: int) -> None:
        memory = self.name("memory")
        self.namespace[memory] = [_STRINGS_OF_NOTHING]
        self.line(depth, f"known, names = {memory}[0]")
        # The remembered bytes include count and lengths, so equal bytes mean equal strings.
        self.line(depth, "if data.startswith(known, at):")
        self.line(depth + 1, f"{operand} = [*names]; at += len(known) - 4")
        self.line(depth, "else:")
        self.line(depth + 1, f"{operand}, at = strings(data, at, {count}, {memory})")
        self.lose_position()
