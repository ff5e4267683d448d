"""A router, a node beside the bridge, and clients that keep the frames that they get."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cbor2
import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket
from tests.integration.robot import FOUND_BY_OTHERS_S, ON_DDS, discovery_server
from tests.unit.serve.rosbridge.robot import Robot

from throwcollect.ros import Context, ExternalShutdownException, Node, SingleThreadedExecutor, init
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware, uses_rclpy
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey
from throwcollect.serve.rosbridge import Bridge, Requests, attend
from throwcollect.serve.rosbridge.codec import LONGEST_FRAME
from throwcollect.serve.server_process import WEBSOCKETS

PATIENCE_S = 60.0


def wait_for(condition: Callable[[], Any], what: str = "") -> Any:
    """Wait until a condition is true, and return its value."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < deadline, f"did not happen: {what}"
        time.sleep(0.002)
    return found


def wait_for_listener(publisher: Any) -> None:
    """Wait until somebody listens to a publisher, and knows of it."""
    wait_for(publisher.get_subscription_count, f"somebody listens to {publisher.topic_name}")
    if ON_DDS:
        # On DDS, neither side knows when the other one has found it.
        time.sleep(FOUND_BY_OTHERS_S)


class Party:
    """A client without a network, with the frames that it got so far, parsed."""

    def __init__(self, bridge: Bridge, *, read_only: bool = False) -> None:
        self.frames: list[str | bytes] = []
        self.times: list[float] = []
        self.client = Requests(bridge, self._take, read_only=read_only)
        self._taken = 0

    def _take(self, frame: str | bytes) -> None:
        self.times.append(time.monotonic())
        self.frames.append(frame)

    def ask(self, **fields: Any) -> None:
        self.client.receive(json.dumps(fields))

    def got(self) -> list[Any]:
        return [json.loads(frame) if isinstance(frame, str) else cbor2.loads(frame) for frame in list(self.frames)]

    def next(self, **wanted: Any) -> Any:
        """The first operation that has these fields among those that were not taken yet."""

        def find() -> Any:
            for number, each in enumerate(self.got()[self._taken :], self._taken + 1):
                if all(each.get(name) == value for name, value in wanted.items()):
                    self._taken = number
                    return each
            return None

        return wait_for(find, f"{wanted} in {self.got()[self._taken :]}")

    def call(self, service: str, /, **arguments: Any) -> Any:
        """Fields of the response of a service; or why it failed."""
        self.ask(op="call_service", id=f"call {service}", service=service, args=arguments)
        return self.next(op="service_response", id=f"call {service}")["values"]


def wait_for_robot(party: Party) -> None:
    """Wait until the bridge sees all that a `Robot` offers: clients ask for it only once."""

    def sees_all() -> bool:
        seen = party.call("rosapi/node_details", node="/other")
        return (
            {"/words", "/states", "/rosout"} <= set(seen["publishing"])
            and "/orders" in seen["subscribing"]
            and {"/lamp", "/other/get_parameters"} <= set(seen["services"])
            and party.call("rosapi/action_servers") == {"action_servers": ["/follow"]}
        )

    wait_for(sees_all, "the bridge sees all of the robot")
    if ON_DDS:
        time.sleep(FOUND_BY_OTHERS_S)


@pytest.fixture(scope="session")
def connection() -> Iterator[Connection]:
    middleware = Middleware.of_process()
    with discovery_server() if ON_DDS else router("tcp/127.0.0.1:0") as endpoint:
        yield Connection(endpoint, RunKey(Path("/no/key")), middleware=middleware)


@pytest.fixture(scope="session")
def bridge(connection: Connection) -> Iterator[Bridge]:
    bridge = Bridge(connection)
    yield bridge
    bridge.close()


@pytest.fixture(autouse=True)
def _nothing_fails(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Check that the bridge has logged nothing: an error in it would fail neither the bridge nor a test."""
    yield
    assert [each.exc_info for each in caplog.records if each.name.startswith("throwcollect.serve")] == []


@contextmanager
def serve_by_websocket(bridge: Bridge) -> Iterator[str]:
    """Serve a bridge over WebSockets, and give its address."""

    async def route(websocket: WebSocket) -> None:
        await websocket.accept()
        await attend(websocket, bridge, read_only=False)

    app = Starlette(routes=[WebSocketRoute("/", route)])
    options: dict[str, Any] = {
        "lifespan": "off",
        "ws": WEBSOCKETS,
        "ws_max_size": LONGEST_FRAME,
        "ws_per_message_deflate": False,
        "timeout_graceful_shutdown": 1,
    }
    config = uvicorn.Config(app, port=0, log_level="warning", **options)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    wait_for(lambda: server.started)
    yield f"ws://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    server.should_exit = True
    thread.join()


@pytest.fixture(scope="session")
def url(bridge: Bridge) -> Iterator[str]:
    """Address of the bridge, over WebSockets."""
    with serve_by_websocket(bridge) as address:
        yield address


@pytest.fixture
def party(bridge: Bridge) -> Iterator[Party]:
    party = Party(bridge)
    yield party
    party.client.close()


@pytest.fixture(scope="session")
def context(connection: Connection) -> Iterator[Context]:
    context = Context()
    init(context=context, connection=connection)
    yield context
    context.try_shutdown()


@pytest.fixture
def node(context: Context, bridge: Bridge) -> Iterator[Node]:
    """A spinning node of ROS; the bridge does not see an embedded one any more when the next test begins."""
    node = Node("other", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield node
    executor.shutdown()
    thread.join()
    node.destroy_node()
    if uses_rclpy():
        # Actions and others keep a genuine node alive until Python collects it, so waiting is useless.
        return
    observer = Party(bridge)
    wait_for(lambda: "/other" not in observer.call("rosapi/nodes")["nodes"], "the node is seen no more")
    observer.client.close()


@pytest.fixture
def robot(node: Node, party: Party) -> Robot:
    """A node that has one of everything, all of which the bridge sees."""
    robot = Robot(node)
    wait_for_robot(party)
    return robot
