"""Addresses at which a router listens, and at which others reach it."""

from __future__ import annotations

import pytest

from throwcollect.config.run import RunConfig
from throwcollect.ros.router_endpoint import (
    format_endpoint,
    reach_from_elsewhere,
    reach_from_here,
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
