"""Ports and addresses at which a router listens."""

from __future__ import annotations

import socket
from ipaddress import ip_address

from throwcollect.config.run import RunConfig
from throwcollect.errors import ConfigError, Problem
from throwcollect.ros.router_endpoint import split_address

LOOPBACK = "127.0.0.1"
_ELSEWHERE = ("192.0.2.1", 9)
"""An address that is reserved for documentation (RFC 5737), so no machine has it."""


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
