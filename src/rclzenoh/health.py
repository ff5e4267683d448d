"""Asks a node for a sign of life at next to no cost, as health checks run often.

A request goes to a service that every node offers. The loop that does the node's work answers it, so a node that is
stuck does not answer, even if its process looks alive. The request is put together here without a client node, because
that would have to load all interfaces, and would be announced to everybody in the ROS graph.
"""

from __future__ import annotations

import os
import struct
import time

import zenoh

from rclzenoh.attachment import GID_LENGTH, Attachment
from rclzenoh.keys import data_key

_ANY_HASH = "*"
"""Stands for any type hash; computing the right one would need all interfaces to be loaded."""

REQUEST = b"\0\1\0\0" + struct.pack("<I", 0)
"""CDR of ``rcl_interfaces/srv/GetParameters_Request`` that asks for no parameter."""


def node_answers(session: zenoh.Session, node: str, *, domain_id: int, timeout_s: float) -> bool:
    """Ask a node for a sign of life, and wait ``timeout_s`` for it.

    The node is given by its full name without the first slash; ``**/`` in front of a name stands for any namespace.
    """
    replies = session.get(
        data_key(domain_id, f"{node}/get_parameters", "rcl_interfaces/srv/GetParameters", _ANY_HASH),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=timeout_s,
        payload=REQUEST,
        attachment=attachment(),
    )
    return any(reply.ok is not None for reply in replies)


def attachment() -> bytes:
    """Attachment that a client puts on its first request."""
    return Attachment(1, time.time_ns(), os.urandom(GID_LENGTH)).pack()
