"""A bridge at the other end of a WebSocket."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket
from tests.unit.serve.rosbridge.conftest import wait_for
from websockets.sync.client import connect

from throwcollect.ros import Node, get_message, get_service
from throwcollect.serve.rosbridge import Bridge, attend

String: Any = get_message("std_msgs/msg/String")
Trigger: Any = get_service("std_srvs/srv/Trigger")


@pytest.fixture(scope="module")
def url(bridge: Bridge) -> Iterator[str]:
    async def route(websocket: WebSocket) -> None:
        await attend(websocket, bridge)

    app = Starlette(routes=[WebSocketRoute("/", route)])
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="warning", lifespan="off"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    wait_for(lambda: server.started)
    yield f"ws://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    server.should_exit = True
    thread.join()


def test_topics_are_listed_heard_and_services_called(url: str, node: Node) -> None:
    def switch(_request: Any, response: Any) -> Any:
        response.success, response.message = True, "on"
        return response

    service = node.create_service(Trigger, "/switch", switch)
    publisher = node.create_publisher(String, "/words", 10)
    with connect(url) as socket:

        def ask(**fields: Any) -> Any:
            socket.send(json.dumps(fields))
            return json.loads(socket.recv())

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
        wait_for(publisher.get_subscription_count)
        publisher.publish(String(data="hello"))
        assert json.loads(socket.recv()) == {"op": "publish", "topic": "words", "msg": {"data": "hello"}}
    wait_for(lambda: not publisher.get_subscription_count(), "who has left hears nothing any more")
    node.destroy_service(service)
