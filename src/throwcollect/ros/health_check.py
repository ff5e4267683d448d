"""Asks a node for a sign of life, from wherever its router can be reached; containers look at a `heartbeat` instead.

A request goes to a service that every node offers. The loop that does the node's work answers it, so a node that is
stuck does not answer, even if its process looks alive. The request is put together here without a client node, because
that would have to load all interfaces, and would be announced to everybody in the ROS graph.
"""

from __future__ import annotations

import os
import socket
import struct
import time

import zenoh

from rclzenoh.endpoint import GID_LENGTH, Attachment
from rclzenoh.keys import data_key
from rclzenoh.session_config import OPEN, connect_endpoint, domain_of_environment, environment_config
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.heartbeat import is_beating
from throwcollect.ros.connection import zenoh_errors
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import split_address

NODE_VARIABLE = "THROWCOLLECT_NODE"
"""Name of the environment variable that names the node of a container."""

TIMEOUT_S = 3.0
"""Time to open the session, and again to get the answer."""

REQUEST = b"\0\1\0\0" + struct.pack("<I", 0)
"""CDR of ``rcl_interfaces/srv/GetParameters_Request`` that asks for no parameter."""
_ANY_HASH = "*"
"""Stands for any type hash; computing the right one would need all interfaces to be loaded."""
_ROUTER, _COORDINATOR = "router", "coordinator"


def check(node: str | None = None) -> None:
    """Ask a node for a sign of life.

    Args:
        node: ``router``, ``coordinator``, or the name of a simulation; None for the one that ``THROWCOLLECT_NODE``
            names.
    """
    name = node or os.environ.get(NODE_VARIABLE)
    if not name:
        raise ConfigError("health: no node is named", expected="router, coordinator, or the name of a simulation")
    is_fast_dds = Middleware.of_process().is_fast_dds
    if is_fast_dds and name != _ROUTER:
        # A request over DDS would cost too much. Instead, the loop of the node in this container keeps a heartbeat.
        if not is_beating():
            raise ThrowcollectError(f"{name}: does not answer")
        return
    with zenoh_errors():
        endpoint, config, domain_id = connect_endpoint(), environment_config(), domain_of_environment()
    if is_fast_dds and endpoint is not None and not endpoint.startswith(OPEN):
        _check_discovery_server(endpoint)
        return
    config.insert_json5("transport/unicast/open_timeout", str(round(TIMEOUT_S * 1000)))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise ThrowcollectError(
            f"{name}: no session with the router: {config.get_json('connect/endpoints')}"
        ) from error
    try:
        # The namespace of a simulation has the simulation's own name, or is the root.
        path = name if name == _COORDINATOR else f"**/{name}"
        if name != _ROUTER and not node_answers(session, path, domain_id=domain_id, timeout_s=TIMEOUT_S):
            raise ThrowcollectError(f"{name}: does not answer")
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _check_discovery_server(endpoint: str) -> None:
    """Check that the router of a private run on Fast DDS takes a connection."""
    try:
        with socket.create_connection(split_address(endpoint), TIMEOUT_S) as connection:
            # The router closes the connection at once; if it is stuck, it does not, and this times out.
            connection.recv(1)
    except OSError as error:
        raise ThrowcollectError(f"{_ROUTER}: no session with the router at {endpoint}: {error}") from error


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
