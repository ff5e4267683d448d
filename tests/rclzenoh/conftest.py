"""Nodes in sessions of their own, connected by a real router."""

import itertools
import json
import socket

import pytest
import zenoh

from rclzenoh.session_config import OVERRIDE_VARIABLE, router_config
from tests.contract.rig import Rig

_domains = itertools.count(1)


@pytest.fixture(scope="session")
def endpoint():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with zenoh.open(router_config(endpoint)):
        yield endpoint


@pytest.fixture
def environment(endpoint, monkeypatch):
    """Environment variables that lead to the router, in a domain of the test's own."""
    values = {
        OVERRIDE_VARIABLE: f"connect/endpoints={json.dumps([endpoint])}",
        "ROS_DOMAIN_ID": str(next(_domains) % 200),
    }
    monkeypatch.delenv("ZENOH_SESSION_CONFIG_URI", raising=False)
    for name, value in values.items():
        monkeypatch.setenv(name, value)
    return values


@pytest.fixture
def rig(environment):
    rig = Rig()
    yield rig
    rig.close()
