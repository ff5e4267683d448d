"""Serialises messages to CDR and back, with two functions that are written for each type of message.

The wire format is plain CDR, little endian, as Fast-CDR writes it for ROS 2: four bytes ``00 01 00 00``, then the body,
in which each primitive is aligned to its size, counted from the body's first byte.

The functions are fast because nested structures are inlined, neighbouring primitives go through one `struct` call with
the padding in its format, arrays are copied as they lie in memory, and lists of strings (joint names as a rule) are
remembered. Functions that rosbags generates from the same definitions take up to 14 times as long.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, TypeVar

import numpy as np

from rclzenoh.interfaces.catalog import Field, structure
from rclzenoh.interfaces.message import CODES, DTYPES, Message, is_numbers, message_class

_M = TypeVar("_M", bound=Message)
_HEADER = b"\x00\x01\x00\x00"
"""Encapsulation header of little-endian plain CDR."""
_PADDING = tuple(bytes(count) for count in range(8))


def serialize(message: Message) -> bytes:
    """Little-endian CDR of a message, with the encapsulation header."""
    try:
        return bytes(_codec(message.TYPE)[0](message))
    except (AttributeError, TypeError) as error:
        raise TypeError(f"{message.TYPE} cannot be serialised: {error}") from error
    except (struct.error, OverflowError, ValueError) as error:
        raise ValueError(f"{message.TYPE} cannot be serialised: {error}") from error


def deserialize(data: bytes, kind: type[_M]) -> _M:
    """Message from its bytes: little-endian CDR with its encapsulation header.

    The message shares no memory with ``data``, and its number sequences may be changed. Bytes after the message are
    ignored: rmw_serialize gives as many bytes as the message might take, and programs publish all of them.
    """
    name = kind.TYPE
    # Only the first two bytes of the header name the encoding. The others are options (DDSI-RTPS, serialized payload).
    if data[:2] != _HEADER[:2] or len(data) < len(_HEADER):
        raise ValueError(f"{name}: not little-endian CDR: begins with {bytes(data[:4]).hex(' ') or 'nothing'}")
    body = data[4:]
    try:
        message: _M
        message, end = _codec(name)[1](body, bytearray(body))
    except (struct.error, ValueError) as error:
        raise ValueError(f"{name}: malformed CDR of {len(data)} bytes: {error}") from error
    if end > len(body):
        raise ValueError(f"{name}: expected {end + 4} bytes of CDR, got {len(data)}")
    return message


@cache
def _codec(name: str) -> tuple[Callable[[Any], bytearray], Callable[[bytes, bytearray], tuple[Any, int]]]:
    """Function that serialises a message; and one of a body and a copy of it, that makes a message and gives its end.

    Numbers of the message are views of the copy.
    """
    writer = _Writer()
    writer.structure(name, "message", 1)
    writer.flush(1)
    encode = ["def encode(message):", " out = bytearray(HEADER)", *writer.encode, " return out"]
    decode = ["def decode(body, memory):", " at = 0", *writer.decode, " return message, at"]
    exec("\n".join(encode + decode), writer.namespace)  # noqa: S102 - names come from the definitions alone
    return writer.namespace["encode"], writer.namespace["decode"]


@lru_cache(maxsize=512)
def _write_strings(values: tuple[str, ...]) -> bytes:
    """A sequence of strings without its count, from a position that is a multiple of four."""
    out = bytearray()
    for value in values:
        text = value.encode() + b"\x00"
        out += _PADDING[-len(out) & 3] + struct.pack("<I", len(text)) + text
    return bytes(out)


def _read_strings(body: bytes, start: int, count: int, remembered: list[Any]) -> tuple[list[str], int]:
    """Read a sequence of strings after its count, unless it has the bytes that are remembered of the last one."""
    known_count, known, names = remembered
    if count == known_count and body.startswith(known, start):
        return [*names], start + len(known)
    values, at = [], start
    for _ in range(count):
        at = (at + 3) & -4
        (length,) = struct.unpack_from("<I", body, at)
        values.append(body[at + 4 : at + 3 + length].decode())
        at += 4 + length
    # If the data is cut off, its bytes are not remembered, because complete data may begin with the same bytes.
    if at <= len(body):
        remembered[:] = count, body[start:at], tuple(values)
    return values, at


class _Writer:
    """Writes the lines of the two functions of one structure.

    Most operands are expressions of a field, which the one function reads and the other sets.
    """

    def __init__(self) -> None:
        self.encode: list[str] = []
        self.decode: list[str] = []
        self.namespace: dict[str, Any] = {
            "HEADER": _HEADER,
            "PADDING": _PADDING,
            "new": object.__new__,
            "from_memory": np.frombuffer,
            "write_strings": _write_strings,
            "read_strings": _read_strings,
        }
        # The position in the body is a multiple of the first number plus the second.
        self._base, self._offset = 8, 0
        # Neighbouring primitives, collected for one call of `struct`.
        self._format = ""
        self._operands: list[str] = []
        self._names = 0

    def structure(self, name: str, operand: str, depth: int) -> None:
        """Go through a structure."""
        part, kind = self._name("part"), self._name("class", message_class(name))
        self._line(depth, f"{part} = {operand}", f"{part} = {operand} = new({kind})")
        fields = structure(name).fields
        if not fields:
            # The wire has one byte for a structure without fields.
            self._scalar("x", 1, depth)
        for field in fields:
            if is_numbers(field):
                self._numbers(field, f"{part}._{field.name}", depth)
            elif field.length is None and not field.sequence:
                self._element(field, f"{part}.{field.name}", depth)
            else:
                self._list(field, f"{part}.{field.name}", depth)

    def flush(self, depth: int) -> None:
        """Go through the primitives that were collected so far."""
        if self._format:
            layout = struct.Struct("<" + self._format)
            pack, unpack = self._name("pack", layout.pack), self._name("unpack", layout.unpack_from)
            operands = ", ".join(self._operands)
            self._line(depth, f"out += {pack}({operands})", f"[{operands}] = {unpack}(body, at); at += {layout.size}")
        self._format, self._operands = "", []

    def _name(self, prefix: str, value: object = None) -> str:
        """A new name for a local variable, or for a value that both functions use."""
        self._names += 1
        name = f"{prefix}{self._names}"
        if value is not None:
            self.namespace[name] = value
        return name

    def _line(self, depth: int, encode: str, decode: str) -> None:
        self.encode.append(" " * depth + encode)
        self.decode.append(" " * depth + decode)

    def _scalar(self, code: str, size: int, depth: int, *operands: str) -> None:
        """Collect a primitive."""
        if self._base < size:
            self._align(size, depth)
        padding = -self._offset % size
        self._format += "x" * padding + code
        self._operands += operands
        self._offset += padding + size

    def _align(self, size: int, depth: int) -> None:
        """Flush and go on to a multiple of a size."""
        self.flush(depth)
        if self._base >= size and self._offset % size == 0:
            return
        # The length of the header before the body is a multiple of four, but not of eight.
        self._line(depth, f"out += PADDING[4 - len(out) & {size - 1}]", f"at = at + {size - 1} & -{size}")
        self._base, self._offset = size, 0

    def _lose_position(self) -> None:
        self._base, self._offset = 1, 0

    def _element(self, field: Field, operand: str, depth: int) -> None:
        """Go through a field that is neither sequence nor array, or through one element of it."""
        if field.nested:
            self.structure(field.type, operand, depth)
        elif field.type == "string":
            text, length = self._name("text"), self._name("length")
            self.encode.append(" " * depth + f'{text} = {operand}.encode() + b"\\0"; {length} = len({text})')
            self._scalar("I", 4, depth, length)
            self.flush(depth)
            # The terminating zero is left out. This also reads a length of 0, with which some write an empty string.
            self._line(depth, f"out += {text}", f"{operand} = body[at : at + {length} - 1].decode(); at += {length}")
            self._lose_position()
        else:
            self._scalar(CODES[field.type], DTYPES[field.type].itemsize, depth, operand)

    def _numbers(self, field: Field, operand: str, depth: int) -> None:
        dtype = DTYPES[field.type]
        kind, size = self._name("dtype", dtype), dtype.itemsize
        # The memory can be copied as it is, because `as_numbers` has made it contiguous and of the field's type.
        if field.length is not None:
            self._align(size, depth)
            read = f"{operand} = from_memory(memory, {kind}, {field.length}, at); at += {size * field.length}"
            self._line(depth, f"out += {operand}.data", read)
            self._offset += size * field.length
            return
        count, empty = self._name("count"), self._name("empty", np.zeros(0, dtype))
        self.encode.append(" " * depth + f"{count} = {operand}.size")
        self._scalar("I", 4, depth, count)
        self.flush(depth)
        self._line(depth, f"if {count}:", f"{operand} = {empty}")
        self.decode.append(" " * depth + f"if {count}:")
        self._align(size, depth + 1)
        read = f"{operand} = from_memory(memory, {kind}, {count}, at); at += {size} * {count}"
        self._line(depth + 1, f"out += {operand}.data", read)
        # Padding belongs to the first number and not to the count, so an empty sequence has none.
        self._base, self._offset = min(size, 4), 0

    def _list(self, field: Field, operand: str, depth: int) -> None:
        """Go through a sequence or array of strings or structures."""
        values, count, item = self._name("values"), self._name("count"), self._name("item")
        self.encode.append(" " * depth + f"{values} = {operand}; {count} = len({values})")
        if field.length is None:
            self._scalar("I", 4, depth, count)
            self.flush(depth)
        else:
            self.flush(depth)
            wrong = f"raise ValueError(f'{field.name}: expected {field.length} elements, got {{{count}}}')"
            self._line(depth, f"if {count} != {field.length}: {wrong}", f"{count} = {field.length}")
        if field.type == "string":
            self._align(4, depth)
            remembered = self._name("remembered", [0, b"", ()])
            read = f"{operand}, at = read_strings(body, at, {count}, {remembered})"
            self._line(depth, f"out += write_strings(tuple({values}))", read)
        else:
            self._line(depth, f"for {item} in {values}:", f"{operand} = {values} = []")
            self.decode.append(" " * depth + f"for _ in range({count}):")
            self._lose_position()
            self._element(field, item, depth + 1)
            self.flush(depth + 1)
            self.decode.append(" " * depth + f" {values}.append({item})")
        self._lose_position()
