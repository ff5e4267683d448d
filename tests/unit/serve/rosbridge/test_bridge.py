"""A bridge whose router goes and comes back, and several bridges in one process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for, wait_for_listener

from throwcollect.ros import Context, Node, SingleThreadedExecutor, get_message, init
from throwcollect.ros.connection import Connection
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey
from throwcollect.serve.rosbridge import Bridge, bridge_client

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


def test_topics_services_and_actions_of_a_client_survive_a_router_restart(routers: Routers) -> None:
    bridge = Bridge(routers.connection)
    party = Party(bridge)
    party.ask(op="subscribe", topic="/words", type="std_msgs/String")
    party.ask(op="advertise", topic="/answers", type="std_msgs/String")
    party.ask(op="advertise_service", service="/slow", type="std_srvs/Trigger")
    party.ask(op="advertise_action", action="/act", type="control_msgs/FollowJointTrajectory")
    wait_for(lambda: "/slow" in party.call("rosapi/services")["services"])
    party.ask(op="call_service", id="lost", service="/slow")
    party.next(op="call_service")
    goal = {"op": "send_action_goal", "action": "/act", "action_type": "control_msgs/FollowJointTrajectory"}
    party.ask(**goal, id="goal")
    party.next(op="send_action_goal")
    routers.end()
    wait_for(lambda: {"lost", "goal"} <= {each.get("id") for each in party.got() if each.get("result") is False})
    assert party.next(op="status")["msg"].startswith("the router of the run has gone")
    party.ask(op="call_service", id="waits", service="rosapi/services")
    # At another address, as a router that is begun again may have.
    moved = replace(routers.connection, endpoint=routers.begin("tcp/127.0.0.1:0"))
    bridge.move(moved)
    assert party.next(op="status")["msg"] == "the router of the run is back"
    assert "/slow" in party.next(id="waits")["values"]["services"]
    party.ask(**goal, id="another")
    assert party.next(op="send_action_goal")["action"] == "/act"
    talker = Talker(moved)
    talker.say("again")
    assert party.next(op="publish")["msg"] == {"data": "again"}
    heard: list[Any] = []
    talker.node.create_subscription(String, "/answers", heard.append, 10)
    wait_for(
        lambda: party.call("rosapi/subscribers", topic="/answers")["subscribers"], "the bridge sees the subscriber"
    )
    party.ask(op="publish", topic="/answers", msg={"data": "yes"})
    executor = SingleThreadedExecutor(context=talker.context)
    executor.add_node(talker.node)
    wait_for(lambda: heard or executor.spin_once(timeout_sec=0.01))
    assert {"/slow", "/act/_action/send_goal"} <= set(dict(talker.node.get_service_names_and_types()))
    bridge.close()
    talker.context.try_shutdown()


def test_requests_beyond_a_limit_are_dropped_without_a_router_and_the_client_is_told_once(
    routers: Routers, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bridge_client, "_MOST_FRAMES", 3)
    bridge = Bridge(None)
    party = Party(bridge)
    for number in range(6):
        party.ask(op="call_service", id=number, service="rosapi/get_time")
    assert "further ones are dropped" in party.next(op="status")["msg"]
    bridge.move(routers.connection)
    party.next(id=2)
    party.ask(op="call_service", id="after", service="rosapi/get_time")
    party.next(id="after")
    assert [each["id"] for each in party.got() if each["op"] == "service_response"] == [0, 1, 2, "after"]
    assert len([each for each in party.got() if each.get("level") == "error"]) == 1
    bridge.close()


def test_each_bridge_is_in_its_own_run(routers: Routers, bridge: Bridge, connection: Connection) -> None:
    other = Bridge(None)
    party, stranger = Party(other), Party(bridge)
    for each in (party, stranger):
        each.ask(op="subscribe", topic="/words", type="std_msgs/String")
    other.move(routers.connection)
    talkers = [Talker(routers.connection), Talker(connection)]
    for talker, each, word in zip(talkers, (party, stranger), "ab", strict=True):
        talker.say(word)
        assert each.next(op="publish")["msg"]["data"] == word
    assert [each["msg"]["data"] for each in [*party.got()[1:], *stranger.got()]] == ["a", "b"]
    stranger.client.close()
    other.close()
    for talker in talkers:
        talker.context.try_shutdown()


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
