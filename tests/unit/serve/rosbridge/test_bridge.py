"""A bridge whose router goes, and several bridges in one process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for, wait_for_listener

from throwcollect.errors import UnreachableError
from throwcollect.ros import Context, Node, get_message, init
from throwcollect.ros.connection import Connection
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey
from throwcollect.serve.rosbridge import Bridge

String: Any = get_message("std_msgs/msg/String")


class Routers:
    """A router that can be ended and begun again, at the same address or at another."""

    def __init__(self) -> None:
        self._router: AbstractContextManager[str] | None = None
        self.connection = Connection(self.begin("tcp/127.0.0.1:0"), RunKey(Path("/no/key")))

    def begin(self, endpoint: str) -> str:
        self._router = router(endpoint)
        return self._router.__enter__()

    def end(self) -> None:
        if self._router is not None:
            self._router.__exit__(None, None, None)
        self._router = None


@pytest.fixture
def routers() -> Iterator[Routers]:
    routers = Routers()
    yield routers
    routers.end()


class Talker:
    """A node that says one thing, in a session of its own."""

    def __init__(self, connection: Connection) -> None:
        self.context = Context()
        init(context=self.context, connection=connection)
        self.node = Node("talker", context=self.context)
        self.publisher = self.node.create_publisher(String, "/words", 10)

    def say(self, text: str) -> None:
        wait_for_listener(self.publisher)
        self.publisher.publish(String(data=text))


def test_a_bridge_is_over_when_its_router_has_gone(routers: Routers) -> None:
    bridge = Bridge(routers.connection)
    party = Party(bridge)
    party.ask(op="advertise_service", service="/slow", type="std_srvs/Trigger")
    party.ask(op="subscribe", topic="/words", type="std_msgs/String")
    party.call("rosapi/get_time")
    assert not bridge.is_over
    routers.end()
    wait_for(lambda: bridge.is_over)
    party.ask(op="call_service", id="late", service="rosapi/services")
    party.client.close()
    bridge.close()
    with pytest.raises(UnreachableError, match="the router of the run does not answer"):
        Bridge(routers.connection)


def test_a_closed_bridge_withdraws_its_topics_and_ignores_requests(routers: Routers) -> None:
    bridge = Bridge(routers.connection)
    party = Party(bridge)
    party.ask(op="advertise", topic="/mine", type="std_msgs/String")
    talker = Talker(routers.connection)
    wait_for(lambda: talker.node.count_publishers("/mine"))
    bridge.close()
    wait_for(lambda: not talker.node.count_publishers("/mine"))
    party.ask(op="advertise", topic="/mine", type="std_msgs/String")
    # A bridge that still handles requests answers this one.
    party.ask(op="call_service", service="rosapi/get_time")
    party.client.close()
    bridge.close()
    assert party.got() == []
    assert talker.node.count_publishers("/mine") == 0
    talker.context.try_shutdown()
