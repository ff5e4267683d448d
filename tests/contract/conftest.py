"""Nodes that reach each other and no other nodes, on the backend of this process.

The embedded backend and rmw_zenoh_cpp have a router of the tests' own, Fast DDS has discovery on this host. Each test
has a domain of its own.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from rclzenoh.session_config import CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE
from tests.contract.rig import Rig
from tests.fast_dds import mark_flaky
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router import router

# Above 101, the ports of a domain are among those that any process may be given. Tests at the same time share them out.
_PROCESS, _PROCESSES = os.environ.get("PYTEST_XDIST_WORKER", "gw0"), os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")
_domains = itertools.cycle(range(1 + int(_PROCESS.removeprefix("gw")), 102, int(_PROCESSES)))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    mark_flaky(item for item in items if Path(__file__).parent in item.path.parents)


@pytest.fixture(scope="session")
def way() -> Iterator[Mapping[str, str]]:
    """Environment variables by which nodes find each other."""
    if Middleware.of_process().is_fast_dds:
        yield {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        return
    with router("tcp/127.0.0.1:0") as endpoint:
        yield {OVERRIDE_VARIABLE: f'mode="client";connect/endpoints={json.dumps([endpoint])}'}


@pytest.fixture
def environment(way: Mapping[str, str], monkeypatch: pytest.MonkeyPatch) -> Mapping[str, str]:
    """Environment variables of nodes in a domain of the test's own, which are set."""
    values = {**way, "ROS_DOMAIN_ID": str(next(_domains))}
    for name in (CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE, "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"):
        monkeypatch.delenv(name, raising=False)
    for name, value in values.items():
        monkeypatch.setenv(name, value)
    return values


@pytest.fixture
def rig(environment: Mapping[str, str]) -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.close()
