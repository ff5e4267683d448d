"""Ports of the loopback interface."""

from __future__ import annotations

import socket

from throwcollect.errors import ConfigError, Problem

LOOPBACK = "127.0.0.1"


def reserve_port(wanted: int) -> socket.socket:
    """A socket that keeps a port for the router until it is closed.

    Args:
        wanted: The port; 0 takes a free one.

    Raises:
        ConfigError: If the port is taken.
    """
    probe = socket.socket()
    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        probe.bind((LOOPBACK, wanted))
    except OSError as error:
        probe.close()
        raise ConfigError(
            [Problem(f"port {wanted} of {LOOPBACK} cannot be used: {error.strerror}", "run.router_port")],
            hint="--set run.router_port=0 takes a free one",
        ) from error
    return probe
