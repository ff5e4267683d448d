"""Addresses at which a router listens, and at which others reach it."""

from __future__ import annotations

import socket

import pytest

from throwcollect.config.run import RunConfig
from throwcollect.errors import ConfigError
from throwcollect.ros.router_endpoint import (
    format_endpoint,
    reach_from_elsewhere,
    reach_from_here,
    reserve_port,
    split_address,
)


@pytest.mark.parametrize(
    ("protocol", "host", "port", "endpoint"),
    [("tls", "127.0.0.1", 7447, "tls/127.0.0.1:7447"), ("tcp", "::1", 1, "tcp/[::1]:1"), ("tls", "n1", 2, "tls/n1:2")],
)
def test_an_endpoint_can_be_formatted_and_split_again(protocol: str, host: str, port: int, endpoint: str) -> None:
    assert format_endpoint(protocol, host, port) == endpoint
    assert split_address(endpoint) == (host, port)


def test_a_router_that_listens_everywhere_is_reached_at_a_single_address() -> None:
    everywhere = "0.0.0.0"  # noqa: S104 - nothing listens there
    assert reach_from_here(everywhere) == "127.0.0.1"
    assert reach_from_here("::") == "::1"
    assert reach_from_here("node7") == "node7"
    assert reach_from_elsewhere("10.0.0.1") == "10.0.0.1"
    assert reach_from_elsewhere(everywhere) not in (everywhere, "")


def test_reserving_a_busy_port_is_refused_with_its_key() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=rf"run.router_port: port {port} of 127.0.0.1 cannot be used"):
            reserve_port(RunConfig(router_port=port))
        with pytest.raises(ConfigError, match=rf"run.listen: port {port} of 127.0.0.1 cannot be used"):
            reserve_port(RunConfig(listen=f"tcp/127.0.0.1:{port}"))


@pytest.mark.parametrize("address", ["0.0.0.0:7447", "tcp/0.0.0.0", "tcp/0.0.0.0:0", "tcp/0.0.0.0:70000", "udp/a:1"])
def test_a_malformed_address_to_listen_at_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="should match pattern"):
        RunConfig(listen=address)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"simulations": 0}, "no other machine can join"),
        ({"listen": "tcp/0.0.0.0:7447", "open": True}, "other machines can reach the run"),
        ({"listen": "tcp/0.0.0.0:7447", "runtime": "inprocess"}, "should be local"),
    ],
)
def test_options_that_contradict_joining_from_other_machines_are_refused(
    values: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        RunConfig.model_validate(values)
