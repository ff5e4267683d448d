"""Endpoints at which nodes reach the router of a run, such as ``tls/127.0.0.1:7447``."""

from __future__ import annotations

import socket
import time

_CONNECT_S = 0.5
_POLL_S = 0.05


def split_address(endpoint: str) -> tuple[str, int]:
    """Host and port of an endpoint, such as ``tcp/0.0.0.0:7447``.

    Raises:
        ValueError: If the port is no number.
    """
    # The last colon is that of the port: addresses of IPv6 have others, and stand in brackets because of them.
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host.strip("[]"), int(port)


def answers(endpoint: str, *, patience_s: float = 0.0) -> bool:
    """Whether something listens at an endpoint of TCP or TLS.

    With ``patience_s``, ask again for that long, as the router may just be starting again.
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
