"""A bridge at the other end of a WebSocket."""

from __future__ import annotations

import json
from typing import Any

from tests.unit.serve.rosbridge.conftest import PATIENCE_S, wait_for_listener
from websockets.sync.client import ClientConnection, connect

from throwcollect.ros import HistoryPolicy, Node, QoSProfile, get_message

String: Any = get_message("std_msgs/msg/String")
WHOLE = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""A profile that loses no message: by default, long messages to the bridge are dropped on a busy machine."""


def hear(socket: ClientConnection) -> Any:
    """The next frame, read; one that never comes fails the test instead of holding up all of them."""
    return json.loads(socket.recv(PATIENCE_S))


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
