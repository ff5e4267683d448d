"""Writes, for one structure, a Python function that makes messages from CDR.

The body is copied once into memory of its own, in which number sequences of the message are views that may be changed.
Sequences that claim to be longer than the data end up beyond it, which is noticed when they are read or at the end.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from rclzenoh.interfaces.catalog import Field, structure
from rclzenoh.interfaces.layout import CODES, Alignment
from rclzenoh.interfaces.message import DTYPES, is_numbers, message_class

_STRINGS_OF_NOTHING = (b"\x00\x00\x00\x00", ())


@cache
def decoder(name: str) -> Callable[[bytes, bytearray], tuple[Any, int]]:
    """Function that makes messages of one type from their bytes.

    Args:
        name: Full name of the structure.

    Returns:
        The function. It takes the data with its header and a copy of the body that is padded to a multiple of eight
        bytes, and returns the message and the length of the body that was used; that is more than there is when the
        data is too short. It raises IndexError, ValueError or ``struct.error`` when the data is malformed.
    """
    reader = _Reader()
    reader.structure(name, "message", 1)
    reader.flush(1)
    start = [f" {view} = frombuffer(body, {view}_type)" for view in reader.views]
    source = ["def decode(data, body):", " words = memoryview(body).cast('I')", " at = 0", *start, *reader.lines]
    exec("\n".join([*source, " return message, at"]), reader.namespace)  # noqa: S102 - as in `encoder`
    decode: Callable[[bytes, bytearray], tuple[Any, int]] = reader.namespace["decode"]
    return decode


def _strings(data: bytes, at: int, count: int, memory: list[tuple[bytes, tuple[str, ...]]]) -> tuple[list[str], int]:
    """Read a sequence of strings after its count, and remember its bytes: joint names are the same every time."""
    start = at - 4
    values = []
    for _ in range(count):
        at = (at + 3) & -4
        (length,) = struct.unpack_from("<I", data, at + 4)
        values.append(data[at + 8 : at + 7 + length].decode())
        at += 4 + length
    known = data[start + 4 : at + 4]
    # Not of data that is cut off, which whole data may begin with.
    if len(known) == at - start:
        memory[0] = (known, tuple(values))
    return values, at


class _Reader:
    """Source lines under construction, and what is known of the position at the end of them."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.namespace: dict[str, Any] = {"frombuffer": np.frombuffer, "new": object.__new__, "strings": _strings}
        self.views: dict[str, None] = {}
        self.at = Alignment(8, 0)
        self.run_format = ""
        self.run_targets: list[str] = []
        self.names = 0

    def fresh(self, prefix: str) -> str:
        self.names += 1
        return f"{prefix}{self.names}"

    def line(self, depth: int, text: str) -> None:
        self.lines.append(" " * depth + text)

    def scalar(self, primitive: str, target: str, depth: int) -> None:
        size = struct.calcsize(CODES[primitive])
        padding = self.at.padding(size)
        if padding is None:
            self.align(size, depth)
            padding = 0
        self.run_format += "x" * padding + CODES[primitive]
        self.run_targets.append(target)
        self.at = self.at.after(padding + size)

    def flush(self, depth: int) -> None:
        """Emit the reading of the primitives collected so far."""
        if self.run_targets:
            size = struct.calcsize("<" + self.run_format)
            if self.run_format == "I":
                self.line(depth, f"{self.run_targets[0]} = words[at >> 2]")
            else:
                unpack = self.fresh("unpack")
                self.namespace[unpack] = struct.Struct("<" + self.run_format).unpack_from
                self.line(depth, f"{', '.join(self.run_targets)}, = {unpack}(body, at)")
            self.line(depth, f"at += {size}")
        self.run_format, self.run_targets = "", []

    def align(self, size: int, depth: int) -> None:
        padding = self.at.padding(size)
        self.flush(depth)
        if padding is None:
            self.line(depth, f"at = (at + {size - 1}) & -{size}")
            self.at = Alignment(size, 0)
        elif padding:
            self.line(depth, f"at += {padding}")
            self.at = self.at.after(padding)

    def structure(self, name: str, target: str, depth: int) -> None:
        cls = self.fresh("class")
        self.namespace[cls] = message_class(name)
        local = target if target.isidentifier() else self.fresh("part")
        self.line(depth, f"{local} = {'' if local == target else target + ' = '}new({cls})")
        fields = structure(name).fields
        if not fields:
            self.scalar("uint8", "_", depth)
        for field in fields:
            self.field(field, f"{local}.{'_' if is_numbers(field) else ''}{field.name}", depth)

    def field(self, field: Field, target: str, depth: int) -> None:
        if is_numbers(field):
            self.numbers(field, target, depth)
        elif field.length is None and not field.sequence:
            self.element(field, target, depth)
        else:
            self.elements(field, target, depth)

    def element(self, field: Field, target: str, depth: int) -> None:
        if field.nested:
            self.structure(field.type, target, depth)
        elif field.type == "string":
            length = self.fresh("length")
            self.scalar("uint32", length, depth)
            self.flush(depth)
            # Without the terminating zero; a length of 0, which some writers use for an empty string, works too.
            self.line(depth, f"{target} = data[at + 4 : at + 3 + {length}].decode()")
            self.line(depth, f"at += {length}")
            self.at = Alignment(1, 0)
        else:
            self.scalar(field.type, target, depth)

    def numbers(self, field: Field, target: str, depth: int) -> None:
        dtype = DTYPES[field.type]
        size, view = dtype.itemsize, f"view_{dtype.name}"
        shift = size.bit_length() - 1
        self.views[view] = None
        self.namespace[f"{view}_type"] = dtype
        if field.length is not None:
            self.align(size, depth)
            self.flush(depth)
            self.line(depth, f"{target} = {view}[at >> {shift} : (at >> {shift}) + {field.length}]")
            self.line(depth, f"at += {size * field.length}")
            self.at = self.at.after(size * field.length)
            return
        count, empty = self.fresh("count"), self.fresh("empty")
        self.namespace[empty] = np.zeros(0, dtype)
        self.scalar("uint32", count, depth)
        self.flush(depth)
        before = self.at
        self.line(depth, f"if {count}:")
        self.align(size, depth + 1)
        self.line(depth + 1, f"{target} = {view}[at >> {shift} : (at >> {shift}) + {count}]")
        self.line(depth + 1, f"at += {count} << {shift}" if shift else f"at += {count}")
        self.line(depth, "else:")
        self.line(depth + 1, f"{target} = {empty}")
        self.at = before.either(Alignment(size, 0))

    def elements(self, field: Field, target: str, depth: int) -> None:
        """A sequence or array of strings or structures."""
        count = str(field.length)
        if field.length is None:
            count = self.fresh("count")
            self.scalar("uint32", count, depth)
        self.flush(depth)
        if field.type == "string" and field.length is None:
            self.names_sequence(target, count, depth)
            return
        values, item = self.fresh("values"), self.fresh("item")
        self.line(depth, f"{target} = {values} = []")
        self.line(depth, f"for _ in range({count}):")
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
        self.line(depth + 1, f"{values}.append({item})")
        self.at = before

    def names_sequence(self, target: str, count: str, depth: int) -> None:
        memory = self.fresh("memory")
        self.namespace[memory] = [_STRINGS_OF_NOTHING]
        self.line(depth, f"known, names = {memory}[0]")
        # Count and lengths are part of the bytes, so equal bytes are equal strings.
        self.line(depth, "if data.startswith(known, at):")
        self.line(depth + 1, f"{target} = [*names]; at += len(known) - 4")
        self.line(depth, "else:")
        self.line(depth + 1, f"{target}, at = strings(data, at, {count}, {memory})")
        self.at = Alignment(1, 0)
