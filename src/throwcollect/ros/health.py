"""Whether a node answers, for health checks: they run often and in every container, so they must cost next to nothing.

A request goes to a service that every node offers. Its answer comes from the loop that does the node's work, so a node
that is stuck does not answer, however alive its process looks. The request is put together here, from the names that
the embedded backend gives to keys, as a client node would have to load all interfaces, and everybody in the ROS graph
would hear of it.

``python -m throwcollect.ros.health`` is ``throwcollect health`` without the command line's own cost, five times that of
the check.
"""

from __future__ import annotations

import os
import re
import socket
import struct
import sys
import time

import zenoh

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.heartbeat import is_beating
from throwcollect.ros.embedded.attachment import GID_LENGTH, Attachment
from throwcollect.ros.embedded.domain import domain_of_environment
from throwcollect.ros.embedded.keys import data_key
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.session_config import OPEN, client_config, connect_endpoint

NODE_VARIABLE = "THROWCOLLECT_NODE"
"""Names the node of a container."""

TIMEOUT_S = 3.0
"""Time for the session, and then for the answer."""

_ROUTER, _COORDINATOR = "router", "coordinator"
_NAME = re.compile("[A-Za-z_][A-Za-z0-9_]*")

_ANY_HASH = "*"
"""There is but one, which is worked out from all interfaces."""

REQUEST = b"\0\1\0\0" + struct.pack("<I", 0)
"""CDR of ``rcl_interfaces/srv/GetParameters_Request`` that asks for no parameter."""


def check(node: str | None = None) -> None:
    """Ask a node for a sign of life.

    Args:
        node: ``router``, ``coordinator``, or the name of a simulation; None for the one that ``THROWCOLLECT_NODE``
            names.

    Raises:
        ConfigError: If no node is named, or a variable of the environment does not hold what it should.
        ThrowcollectError: If it does not answer.
    """
    name = node or os.environ.get(NODE_VARIABLE)
    if not name or not _NAME.fullmatch(name):
        raise ConfigError(
            f"health: got {name!r} as node" if name else "health: no node is named",
            expected=f"router, coordinator, or the name of a simulation; by default what {NODE_VARIABLE} says",
        )
    if Middleware.of_process().is_fast_dds:
        if name != _ROUTER:
            _check_heartbeat(name)
            return
        endpoint = connect_endpoint()
        if endpoint is not None and not endpoint.startswith(OPEN):
            _check_discovery_server(endpoint)
            return
    config = client_config()
    config.insert_json5("transport/unicast/open_timeout", str(round(TIMEOUT_S * 1000)))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise ThrowcollectError(
            f"{name}: no session with the router: {config.get_json('connect/endpoints')}"
        ) from error
    try:
        if name != _ROUTER and not _answers(session, name):
            raise ThrowcollectError(f"{name}: does not answer")
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _check_heartbeat(name: str) -> None:
    """Whether the loop of the node in this container goes on.

    Raises:
        ThrowcollectError: If it does not.
    """
    if not is_beating():
        raise ThrowcollectError(f"{name}: does not answer")


def _check_discovery_server(endpoint: str) -> None:
    """Whether the router of a private run on Fast DDS takes a connection.

    Raises:
        ThrowcollectError: If it does not.
    """
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    try:
        with socket.create_connection((host, int(port)), TIMEOUT_S) as connection:
            # It hangs up at once; one that is stuck does not.
            connection.recv(1)
    except OSError as error:
        raise ThrowcollectError(f"{_ROUTER}: no session with the router at {endpoint}: {error}") from error


def attachment() -> bytes:
    """What a client puts on its first request."""
    return Attachment(1, time.time_ns(), os.urandom(GID_LENGTH)).pack()


def _answers(session: zenoh.Session, name: str) -> bool:
    # A simulation lives in a namespace of its own name, or in that of the root.
    path = name if name == _COORDINATOR else f"**/{name}"
    replies = session.get(
        data_key(domain_of_environment(), f"{path}/get_parameters", "rcl_interfaces/srv/GetParameters", _ANY_HASH),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=TIMEOUT_S,
        payload=REQUEST,
        attachment=attachment(),
    )
    return any(reply.ok is not None for reply in replies)


def main() -> int:
    """Ask the node that the environment names.

    Returns:
        Exit code.
    """
    try:
        check()
    except ThrowcollectError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
