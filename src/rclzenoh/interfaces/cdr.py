"""Messages to bytes and back: CDR as it is on the wire and in MCAP files."""

from __future__ import annotations

import struct
from typing import TypeVar

from rclzenoh.interfaces.decoder import decoder
from rclzenoh.interfaces.encoder import HEADER, encoder
from rclzenoh.interfaces.message import Message

_M = TypeVar("_M", bound=Message)


def serialize(message: Message) -> bytes:
    """Little-endian CDR of a message, with the encapsulation header."""
    try:
        return bytes(encoder(message.TYPE)(message))
    except (AttributeError, TypeError) as error:
        raise TypeError(f"{message.TYPE} cannot be serialised: {error}") from error
    except (struct.error, OverflowError, ValueError) as error:
        raise ValueError(f"{message.TYPE} cannot be serialised: {error}") from error


def deserialize(data: bytes, message_class: type[_M]) -> _M:
    """Message from its bytes: little-endian CDR with its encapsulation header.

    The message shares no memory with ``data``, and its number sequences may be changed. Bytes after the message are
    ignored: rmw_serialize gives as many bytes as the message might take, and programs publish all of them.
    """
    name = message_class.TYPE
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
