"""Frames of the protocol: JSON, and for clients that ask for it, CBOR.

Numbers are written as rosbridge_suite writes them. In JSON, octets are Base64, and NaN and infinities are null. In
CBOR, octets are bytes and other arrays of numbers are typed arrays (RFC 8746), little endian.
"""

from __future__ import annotations

import base64
import itertools
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

import cbor2
import numpy as np
import orjson
from numpy.typing import NDArray

from throwcollect.errors import ConfigError
from throwcollect.ros.message_values import plain
from throwcollect.serve.rosbridge.operations import Fragment, RequestId

LONGEST_FRAME = 10 * 2**20
"""Largest number of bytes of a frame that a client may send, whole or in fragments."""
_OF_A_PART = 64
"""Each part counts as this many characters more than its text, because even an empty part takes memory."""

Frame = str | bytes
"""A text frame or a binary one."""

_TAGS = {"u1": 64, "<u2": 69, "<u4": 70, "<u8": 71, "i1": 72, "<i2": 77, "<i4": 78, "<i8": 79, "<f4": 85, "<f8": 86}
_TAG_OF = {np.dtype(kind): tag for kind, tag in _TAGS.items()}
_NOT_ASCII = re.compile(r"[^\x00-\x7f]+")
_numbers = itertools.count()


def read_frame(frame: Frame) -> Mapping[str, Any]:
    """Read the fields of a frame of a client, which is JSON; ROS# sends it in binary frames."""
    try:
        fields = orjson.loads(frame)
    except ValueError as error:
        raise ConfigError(f"a frame is no JSON: {error}") from error
    if not isinstance(fields, Mapping):
        raise ConfigError(f"a frame should be an object with an op, got {fields!r:.80}")
    return fields


def plain_values(message: Any, compression: str = "none") -> Any:
    """Turn a message into values for `encode` with the same ``compression``; those for JSON have NumPy arrays."""
    return plain(message, _encode_for_json if compression == "none" else _encode_for_cbor)


def encode(fields: object, compression: str = "none") -> Frame:
    """Write a frame: JSON if ``compression`` is ``none``, otherwise CBOR."""
    return json_text(fields) if compression == "none" else bytes(cbor2.dumps(fields))


def json_text(fields: object) -> str:
    """Write JSON in one line, in ASCII, because ROS# treats every byte of a frame as a character."""
    text = orjson.dumps(fields, _encode_bytes, orjson.OPT_SERIALIZE_NUMPY).decode()
    # orjson cannot escape characters beyond ASCII; `json` does, in the form that JSON demands.
    return text if text.isascii() else _NOT_ASCII.sub(lambda found: json.dumps(found[0])[1:-1], text)


def cut(frame: Frame, size: int) -> Iterator[Frame]:
    """Cut a text frame into fragments of at most ``size`` characters, if it is longer and ``size`` is not 0."""
    if isinstance(frame, bytes) or not 0 < size < len(frame):
        yield frame
        return
    whole = {"op": "fragment", "id": str(next(_numbers)), "total": -(-len(frame) // size)}
    for number, start in enumerate(range(0, len(frame), size)):
        yield json_text({**whole, "num": number, "data": frame[start : start + size]})


class Reassembly:
    """Collects the parts of frames of one client."""

    def __init__(self) -> None:
        self._frames: dict[RequestId, dict[int, str]] = {}
        self._size = 0

    def add(self, part: Fragment) -> str | None:
        """Take a part, and return the frame if this was its last part."""
        parts = self._frames.setdefault(part.id, {})
        if part.num not in parts:
            parts[part.num] = part.data
            self._size += len(part.data) + _OF_A_PART
        is_whole = len(parts) >= part.total
        if is_whole or self._size > LONGEST_FRAME:
            del self._frames[part.id]
            self._size -= sum(len(each) + _OF_A_PART for each in parts.values())
            if not is_whole:
                raise ConfigError(f"fragment: should have at most {LONGEST_FRAME} characters in all parts together")
        return "".join(parts[number] for number in sorted(parts)) if is_whole else None


def _encode_bytes(value: Any) -> str:
    if not isinstance(value, bytes):
        raise TypeError
    return base64.b64encode(value).decode()


def _encode_for_json(values: NDArray[Any], kind: str) -> Any:
    return values.tobytes() if kind == "uint8" else np.ascontiguousarray(values)


def _encode_for_cbor(values: NDArray[Any], kind: str) -> Any:
    if kind in ("uint8", "octet"):
        return values.tobytes()
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return cbor2.CBORTag(_TAG_OF[little.dtype], little.tobytes())
