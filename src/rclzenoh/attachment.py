"""The attachment that rmw_zenoh_cpp (0.2.4 and later) puts on every sample, request and reply."""

from __future__ import annotations

import struct
from typing import NamedTuple

_LAYOUT = struct.Struct("<qqB16s")
GID_LENGTH = 16
"""Length of the identifier of an endpoint [bytes]."""


class Attachment(NamedTuple):
    """Who sent something, and when.

    Attributes:
        sequence: Number of the message, counted from 1 by its sender; a reply has that of the request.
        source_timestamp: System time of the sender [ns].
        gid: Identifier of the sending endpoint; a reply has that of the request.
    """

    sequence: int
    source_timestamp: int
    gid: bytes

    def pack(self) -> bytes:
        """The 33 bytes on the wire."""
        return _LAYOUT.pack(self.sequence, self.source_timestamp, GID_LENGTH, self.gid)


def unpack(data: bytes) -> Attachment:
    """Attachment from its bytes."""
    if len(data) != _LAYOUT.size or data[16] != GID_LENGTH:
        raise ValueError(f"attachment of {len(data)} bytes is not that of a ROS 2 Jazzy node")
    sequence, timestamp, _, gid = _LAYOUT.unpack(data)
    return Attachment(sequence, timestamp, gid)
