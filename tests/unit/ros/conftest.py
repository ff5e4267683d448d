"""Nodes in sessions of their own, connected by a real router."""

import itertools
import json
import time

import pytest

from throwcollect.ros import Context, Node, SingleThreadedExecutor
from throwcollect.ros.router import router
from throwcollect.session_config import OVERRIDE_VARIABLE

_domains = itertools.count(1)


@pytest.fixture(scope="session")
def endpoint():
    with router("tcp/127.0.0.1:0") as endpoint:
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


class Rig:
    """Nodes, each in a session of its own unless told otherwise, and a way to spin them all."""

    def __init__(self):
        self.contexts = []
        self.executors = []

    def context(self):
        context = Context()
        context.init()
        self.contexts.append(context)
        return context

    def node(self, name, *, context=None, **options):
        node = Node(name, context=context or self.context(), **options)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        self.executors.append(executor)
        return node

    def spin(self, until, timeout=5.0):
        """Spin until a condition is true; returns whether it became so."""
        deadline = time.monotonic() + timeout
        while not until():
            if time.monotonic() > deadline:
                return False
            for executor in self.executors:
                executor.spin_once(timeout_sec=0.001)
        return True

    def result(self, future, timeout=5.0):
        assert self.spin(future.done, timeout), "no result"
        return future.result()

    def rest(self, seconds=0.1):
        """Spin for a while, so that what should not happen had its chance."""
        self.spin(lambda: False, seconds)


@pytest.fixture
def rig(environment):
    rig = Rig()
    yield rig
    for context in rig.contexts:
        context.try_shutdown()
