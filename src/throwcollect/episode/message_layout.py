"""Byte layout of CDR messages whose strings and sequence lengths never change.

Such a message has every number at a constant place, so many of them are written as columns of one array. The encoding
is plain CDR (XCDR1, little endian): 4 bytes of encapsulation header, then the fields in order, each primitive aligned
to its own size counted from the end of that header (OMG DDSI-RTPS 2.3, 10.2; DDS-XTypes 1.3, 7.4.1).
"""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rclzenoh.interfaces import Message, serialize
from rclzenoh.interfaces.catalog import Field
from rclzenoh.interfaces.message import DTYPES

_ENCAPSULATION_BYTES = 4


class _Numbers(NamedTuple):
    """A run of equal primitives: the path of the field that holds them, and where they are."""

    path: str
    dtype: str
    shape: tuple[int, ...]
    offset: int

    @property
    def end(self) -> int:
        return self.offset + np.dtype((self.dtype, self.shape)).itemsize


def _align(offset: int, size: int) -> int:
    return -(-offset // size) * size


def _walk(message: Message, path: str, offset: int) -> Generator[_Numbers, None, int]:
    """Find the places of all numbers of a message, in order, and return the place of its end."""
    for field in message.FIELDS:
        if field.sequence:
            # The number of elements comes first, as uint32.
            offset = _align(offset, 4) + 4
        offset = yield from _walk_field(field, getattr(message, field.name), f"{path}{field.name}", offset)
    return offset


def _walk_field(field: Field, value: Any, path: str, offset: int) -> Generator[_Numbers, None, int]:
    is_array = field.sequence or field.length is not None
    if field.type in DTYPES:
        shape = (len(value),) if is_array else ()
        # A sequence without elements has no padding for the alignment of elements either.
        if 0 in shape:
            return offset
        dtype = DTYPES[field.type].newbyteorder("<")
        numbers = _Numbers(path, dtype.str, shape, _align(offset, dtype.itemsize))
        yield numbers
        return numbers.end
    for index, element in enumerate(value if is_array else [value]):
        if field.nested:
            prefix = f"{path}.{index}." if is_array else f"{path}."
            offset = yield from _walk(element, prefix, offset)
        else:
            offset = _align(offset, 4) + 4 + len(element.encode()) + 1  # a string
    return offset


class MessageLayout:
    """Template of one message and the places of the fields that vary.

    Attributes:
        template: CDR bytes of the message it was made from.
        dtype: Structured type as large as the template; its fields are the variable ones, named by their dotted paths.

    Args:
        message: A message with the strings and sequence lengths of all messages.
        variable: Dotted paths of the fields that vary, such as ``header.stamp.sec`` or ``position``; elements of
            sequences of messages are numbered. A path of a message whose numbers are all of one type and lie side by
            side, such as a vector, stands for all of them.

    Raises:
        ValueError: If a path names no numbers, or numbers that do not lie side by side.
    """

    def __init__(self, message: Message, variable: Sequence[str]) -> None:
        self.template: bytes = serialize(message)
        numbers = _group(_walk(message, "", 0))
        places = [_merge(numbers.get(path, []), path, message.TYPE) for path in variable]
        self.dtype = np.dtype(
            {
                "names": list(variable),
                "formats": [(place.dtype, place.shape) for place in places],
                "offsets": [_ENCAPSULATION_BYTES + place.offset for place in places],
                "itemsize": len(self.template),
            }
        )
        varies = np.zeros(len(self.template), bool)
        for place in places:
            varies[_ENCAPSULATION_BYTES + place.offset : _ENCAPSULATION_BYTES + place.end] = True
        # A fixed part begins and ends where this changes; beyond the message, everything counts as variable.
        changes = np.flatnonzero(np.diff(varies, prepend=True, append=True)).tolist()
        self._fixed_parts = [slice(start, end) for start, end in zip(changes[::2], changes[1::2], strict=True)]

    def describes_message(self, message: bytes | bytearray) -> bool:
        """Say whether a message differs from the template in nothing but the variable fields."""
        alike = (message[part] == self.template[part] for part in self._fixed_parts)
        return len(message) == len(self.template) and all(alike)


def _group(numbers: Iterable[_Numbers]) -> dict[str, list[_Numbers]]:
    """List the numbers at each path, and at the paths of the messages that they are in."""
    groups: dict[str, list[_Numbers]] = {}
    for place in numbers:
        for path in itertools.accumulate(place.path.split("."), "{}.{}".format):
            groups.setdefault(path, []).append(place)
    return groups


def _merge(inside: Sequence[_Numbers], path: str, type_name: str) -> _Numbers:
    if not inside:
        raise ValueError(f"{type_name} has no numbers at {path!r}")
    if len(inside) == 1:
        return inside[0]
    if any(a.end != b.offset or a.dtype != b.dtype for a, b in itertools.pairwise(inside)):
        raise ValueError(f"{type_name}: the numbers at {path!r} do not lie side by side")
    count = (inside[-1].end - inside[0].offset) // np.dtype(inside[0].dtype).itemsize
    return _Numbers(path, inside[0].dtype, (count,), inside[0].offset)
