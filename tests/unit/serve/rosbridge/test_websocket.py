"""A bridge at the other end of a WebSocket."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import PATIENCE_S, wait_for, wait_for_listener
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import ClientConnection, connect

from throwcollect.ros import HistoryPolicy, Node, QoSProfile, get_message, get_service

String: Any = get_message("std_msgs/msg/String")
Trigger: Any = get_service("std_srvs/srv/Trigger")
WHOLE = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""A profile that loses no message: by default, long messages to the bridge are dropped on a busy machine."""


def hear(socket: ClientConnection) -> Any:
    """The next frame, read; one that never comes fails the test instead of holding up all of them."""
    return json.loads(socket.recv(PATIENCE_S))


def test_a_client_lists_and_hears_topics_and_calls_services(url: str, node: Node) -> None:
    def switch(_request: Any, response: Any) -> Any:
        response.success, response.message = True, "on"
        return response

    service = node.create_service(Trigger, "/switch", switch)
    publisher = node.create_publisher(String, "/words", 10)
    with connect(url) as socket:

        def ask(**fields: Any) -> Any:
            socket.send(json.dumps(fields))
            return hear(socket)

        listed = wait_for(
            lambda: (
                "/words" in (values := ask(op="call_service", service="rosapi/topics")["values"])["topics"] and values
            )
        )
        assert dict(zip(listed["topics"], listed["types"], strict=True))["/words"] == "std_msgs/msg/String"
        assert ask(op="call_service", id="a", service="/switch") == {
            "op": "service_response",
            "id": "a",
            "service": "/switch",
            "values": {"success": True, "message": "on"},
            "result": True,
        }
        socket.send(json.dumps({"op": "subscribe", "topic": "words"}))
        wait_for_listener(publisher)
        publisher.publish(String(data="hello"))
        assert hear(socket) == {"op": "publish", "topic": "words", "msg": {"data": "hello"}}
    wait_for(lambda: not publisher.get_subscription_count(), "who has left hears nothing any more")
    node.destroy_service(service)


def test_a_frame_that_is_too_long_ends_the_connection(url: str) -> None:
    with connect(url) as socket:
        socket.send(json.dumps({"op": "nothing"}))
        assert hear(socket)["op"] == "status"
        # The server stops reading such a frame, so a client that still sends may see a reset in place of code 1009.
        with suppress(ConnectionClosedError):
            socket.send("ä" * (6 * 2**20))
        with pytest.raises(ConnectionClosedError):
            hear(socket)


def test_a_slow_client_loses_the_oldest_frames_and_does_not_block_others(url: str, node: Node) -> None:
    publisher = node.create_publisher(String, "/many", WHOLE)
    subscribe = json.dumps({"op": "subscribe", "topic": "/many", "type": "std_msgs/String"})
    with connect(url, max_queue=1) as slow, connect(url) as quick:
        for each in (slow, quick):
            each.send(subscribe)
            # When the bridge answers this frame, it has taken in the subscription of this client.
            each.send(json.dumps({"op": "nothing"}))
            assert hear(each)["op"] == "status"
        wait_for_listener(publisher)
        # More than the buffers of the connection hold.
        for number in range(100):
            publisher.publish(String(data=f"{number} " + "x" * 500_000))
            assert hear(quick)["msg"]["data"].startswith(f"{number} ")
        publisher.publish(String(data="last"))
        assert hear(quick)["msg"]["data"] == "last"
        told: list[Any] = []
        while not told or told[-1].get("msg") != {"data": "last"}:
            told.append(hear(slow))
        assert len(told) < 100
        statuses = [each["msg"] for each in told if each["op"] == "status"]
        assert len(statuses) == 1
        assert "the oldest are dropped" in statuses[0]
