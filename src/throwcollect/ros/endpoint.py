"""Endpoints at which nodes reach the router of a run, such as ``tls/127.0.0.1:7447``."""

from __future__ import annotations

import socket
from contextlib import suppress

_CONNECT_S = 0.5


def answers(endpoint: str) -> bool:
    """Whether something listens at an endpoint of TCP or TLS."""
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    with suppress(OSError):
        socket.create_connection((host, int(port)), _CONNECT_S).close()
        return True
    return False
