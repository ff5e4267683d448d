"""Endpoints at which nodes reach the router of a run, such as ``tls/127.0.0.1:7447``."""

from __future__ import annotations

import socket
import time

_CONNECT_S = 0.5
_POLL_S = 0.05


def answers(endpoint: str, *, patience_s: float = 0.0) -> bool:
    """Whether something listens at an endpoint of TCP or TLS.

    Args:
        endpoint: Such as ``tls/127.0.0.1:7447``.
        patience_s: How long to go on trying, as what listens there may just be starting again; 0 tries once.
    """
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    deadline = time.monotonic() + patience_s
    while True:
        try:
            socket.create_connection((host, int(port)), _CONNECT_S).close()
        except OSError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL_S)
        else:
            return True
