"""Endpoints at which nodes reach the router of a run, such as ``tls/127.0.0.1:7447``."""

from __future__ import annotations

import socket
import time

_CONNECT_S = 0.5
_POLL_S = 0.05


def split_address(endpoint: str) -> tuple[str, int]:
    """Host and port of an endpoint, such as ``tcp/0.0.0.0:7447``."""
    # The last colon comes before the port: IPv6 addresses contain colons, too, and are therefore in brackets.
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host.strip("[]"), int(port)


def answers(endpoint: str, *, patience_s: float = 0.0) -> bool:
    """Whether something listens at an endpoint of TCP or TLS.

    With ``patience_s``, this tries again for that long [s], as the router may be restarting.
    """
    address = split_address(endpoint)
    deadline = time.monotonic() + patience_s
    while True:
        try:
            socket.create_connection(address, _CONNECT_S).close()
        except OSError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL_S)
        else:
            return True
