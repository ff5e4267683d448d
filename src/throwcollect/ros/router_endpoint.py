"""Endpoints at which a router listens and nodes reach it, such as ``tls/127.0.0.1:7447``, and their ports."""

from __future__ import annotations

import socket
import time
from ipaddress import ip_address

from throwcollect.config.run import RunConfig
from throwcollect.errors import ConfigError, Problem

LOOPBACK = "127.0.0.1"
_ELSEWHERE = ("192.0.2.1", 9)
"""An address that is reserved for documentation (RFC 5737), so no machine has it."""

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


def reserve_port(run: RunConfig) -> socket.socket:
    """Reserve the port of a run's router until the socket is closed: `run.listen`, or one of the loopback interface."""
    if run.listen is None:
        return _bind(LOOPBACK, run.router_port, "run.router_port", hint="--set run.router_port=0 takes a free one")
    host, port = split_address(run.listen)
    return _bind(host, port, "run.listen", hint="tcp/0.0.0.0:PORT listens at all addresses of this machine")


def format_endpoint(protocol: str, host: str, port: int) -> str:
    """An endpoint as Zenoh takes it, such as ``tls/127.0.0.1:7447``."""
    return f"{protocol}/[{host}]:{port}" if ":" in host else f"{protocol}/{host}:{port}"


def _bind(host: str, port: int, key: str, *, hint: str) -> socket.socket:
    probe = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    # Without this, the port counts as taken while closed connections of an earlier router are in the state TIME_WAIT.
    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        probe.bind((host, port))
    except OSError as error:
        probe.close()
        problem = Problem(f"port {port} of {host} cannot be used: {error.strerror}", key)
        raise ConfigError([problem], hint=hint) from error
    return probe


def reach_from_here(host: str) -> str:
    """The address at which processes of this machine reach a process that listens at `host`, maybe at all addresses."""
    if not _is_unspecified(host):
        return host
    return "::1" if ":" in host else LOOPBACK


def reach_from_elsewhere(host: str) -> str:
    """The address at which other machines most likely reach a process here that listens at `host`, maybe at all."""
    if not _is_unspecified(host):
        return host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # For a datagram socket this sends nothing; the system only chooses the address from which it would send.
            probe.connect(_ELSEWHERE)
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])


def _is_unspecified(host: str) -> bool:
    try:
        return ip_address(host).is_unspecified
    except ValueError:
        return False
