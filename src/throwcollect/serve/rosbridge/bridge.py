"""A node in the ROS graph of one run, which acts for all clients of rosbridge, in a thread of its own."""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError, UnreachableError
from throwcollect.ros.connection import Connection
from throwcollect.ros.graph_names import find_interface, find_offered_qos, full_name, make_own_name
from throwcollect.ros.router_endpoint import answers
from throwcollect.serve.rosbridge.codec import Frame, encode, plain_values
from throwcollect.serve.rosbridge.operations import LEVELS, Level, RequestId
from throwcollect.units import NS_PER_S

_logger = logging.getLogger(__name__)

FAREWELL_S = 0.2
"""Time in which nodes get the last results of an action, before it is withdrawn."""
_LOOK_S = 1.0
"""Time between two looks at the router and at the quality of service that publishers offer."""
_MISSES = 2
"""After this many looks without an answer, the router counts as gone; on a busy machine, one answer may be late."""


@dataclass
class Sample:
    """One message of a topic, as it came.

    Attributes:
        data: The message in CDR.
        message_type: Its class.
        received_ns: Time of receipt on the node's clock [ns].
    """

    data: bytes
    message_type: Any
    received_ns: int

    def frame(self, topic: str, compression: str) -> Frame:
        """Encode the message for a client that knows the topic by this name."""
        if compression == "cbor-raw":
            secs, nsecs = divmod(self.received_ns, NS_PER_S)
            content: Any = {"secs": secs, "nsecs": nsecs, "bytes": self.data}
        else:
            content = plain_values(ros.deserialize_message(self.data, self.message_type), compression)
        return encode({"op": "publish", "topic": topic, "msg": content}, compression)


Listener = Callable[[Sample], None]


class Feed:
    """A subscription of one listener to a topic, in the quality of service that its publishers offer."""

    def __init__(self, node: ros.Node, topic: str, type_name: str, listener: Listener) -> None:
        self._node = node
        self._topic = topic
        self._type = ros.get_message(type_name)
        self._listener = listener
        self._subscribe(self._find_offered())

    def renew(self) -> None:
        """Subscribe again if publishers offer another quality of service by now."""
        offered = self._find_offered()
        if (offered.reliability, offered.durability) != (self._offered.reliability, self._offered.durability):
            self.close()
            self._subscribe(offered)

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _find_offered(self) -> ros.QoSProfile:
        # Without publishers, this assumes reliable ones, as most are: if one comes, the subscription need not be
        # renewed, and misses nothing.
        return find_offered_qos(self._node, self._topic, ros.ReliabilityPolicy.RELIABLE)

    def _subscribe(self, offered: ros.QoSProfile) -> None:
        self._offered = offered
        self._subscription = self._node.create_subscription(self._type, self._topic, self._hear, offered, raw=True)

    def _hear(self, data: bytes) -> None:
        self._listener(Sample(bytes(data), self._type, self._node.get_clock().now().nanoseconds))


class Bridge:
    """Takes part in the ROS graph of one run until it is closed, or the router of the run has gone.

    Any thread may call `submit` and `close`; everything else belongs to the bridge's thread, which calls what was
    submitted. Several bridges may live in one process, each in another run. On Fast DDS a process is in one run at a
    time.

    Args:
        connection: The way into the run.

    Attributes:
        node: The node of the bridge.
        is_over: Whether the bridge has left the graph; clients then connect again.
    """

    def __init__(self, connection: Connection) -> None:
        if not answers(connection.endpoint):
            raise UnreachableError("the router of the run does not answer")
        self._endpoint = connection.endpoint
        self._context = ros.Context()
        ros.init(context=self._context, connection=connection)
        self.node = ros.Node(
            make_own_name(), context=self._context, enable_rosout=False, start_parameter_services=False
        )
        ros.let_callbacks_wait(self.node)
        self._executor = ros.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.is_over = False
        self._feeds: list[Feed] = []
        self._clients: dict[tuple[str, str], Any] = {}
        self._work: SimpleQueue[Callable[[], None]] = SimpleQueue()
        # The number orders timers of equal time, because functions cannot be compared.
        self._timers: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._ends = False
        self._misses = 0
        self._changes: int | None = None
        self._thread = threading.Thread(target=self._run, name="rosbridge", daemon=True)
        self._thread.start()

    def submit(self, action: Callable[[], None]) -> None:
        """Call an action soon, in the bridge's thread; when the bridge is over, nothing happens."""
        with self._lock:
            if not self.is_over:
                # rclpy does not do tasks in the order in which they were made, but the queue keeps it.
                self._work.put(action)
                self._executor.create_task(lambda: self._attempt(self._work.get_nowait()))

    def close(self) -> None:
        """Leave the graph, when nodes had time to get the last results."""
        self.submit(lambda: self.later(FAREWELL_S, self._end))
        self._thread.join()

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Call an action after a time [s]."""
        heapq.heappush(self._timers, (time.monotonic() + seconds, next(self._numbers), action))

    def type_of(self, topic: str, wanted: str) -> str:
        """Full name of the type of a topic, which a client may name in full, as ``pkg/Type``, or not at all."""
        # Only the endpoints of this topic are asked for: a list of all topics, made for each of thousands of requests,
        # would keep all clients of the bridge waiting.
        endpoints = self.node.get_publishers_info_by_topic(topic) + self.node.get_subscriptions_info_by_topic(topic)
        types = sorted({each.topic_type for each in endpoints})
        if not wanted:
            if len(types) != 1:
                what = f"has {len(types)} types" if types else "has no publisher, and no type is named"
                raise ConfigError(f"{topic} {what}", expected=f"one of {', '.join(types)}" if types else "a type")
            return types[0]
        name = full_name("msg", wanted)
        find_interface("msg", name)
        if types and name not in types:
            raise ConfigError(f"{topic} is no {name}", expected=", ".join(types))
        return name

    def listen(self, topic: str, type_name: str, listener: Listener) -> Callable[[], None]:
        """Give the messages of a topic to a listener, until the function that is returned is called.

        ``topic`` is the absolute name of the topic, and ``type_name`` the full name of its type. A latched topic begins
        with its earlier messages.
        """
        feed = Feed(self.node, topic, type_name, listener)
        self._feeds.append(feed)

        def stop() -> None:
            self._feeds.remove(feed)
            feed.close()

        return stop

    def service_client(self, service: str, type_name: str) -> Any:
        """A client of a service, given by its absolute name; all clients of the bridge share it."""
        key = service, type_name
        if key not in self._clients:
            self._clients[key] = self.node.create_client(find_interface("srv", type_name), service)
        return self._clients[key]

    def _run(self) -> None:
        self.later(_LOOK_S, self._look)
        while not self._ends:
            wait_s = self._timers[0][0] - time.monotonic() if self._timers else _LOOK_S
            self._attempt(partial(self._executor.spin_once, timeout_sec=max(wait_s, 0.0)))
            while self._timers and self._timers[0][0] <= time.monotonic():
                self._attempt(heapq.heappop(self._timers)[2])
        with self._lock:
            self.is_over = True
        self._attempt(self._leave)

    def _end(self) -> None:
        self._ends = True

    def _attempt(self, action: Callable[[], None]) -> None:
        try:
            action()
        except ros.ExternalShutdownException:
            # Something has shut down all contexts of this process.
            self._end()
        except Exception:
            # A failing action must not end this thread, which serves all clients.
            _logger.exception("an action of the bridge failed")

    def _look(self) -> None:
        """Notice when the router no longer answers, and when publishers offer another quality of service by now."""
        self.later(_LOOK_S, self._look)
        self._misses = 0 if answers(self._endpoint) else self._misses + 1
        if self._misses >= _MISSES:
            self._end()
            return
        changes = ros.graph_changes(self.node)
        if changes != self._changes:
            self._changes = changes
            for feed in self._feeds:
                feed.renew()

    def _leave(self) -> None:
        try:
            self._executor.shutdown()
            self.node.destroy_node()
        finally:
            # At the end of the process, all contexts are shut down.
            self._context.try_shutdown()


class Client:
    """A client of a bridge; only the thread of the bridge calls these methods.

    Attributes:
        bridge: The bridge that the client is connected to.
        level: Status messages that the client wants.
        is_closed: Whether the client has left.
    """

    def __init__(self, bridge: Bridge, send: Callable[[Frame], None]) -> None:
        self.bridge = bridge
        self.level: Level = "error"
        self.is_closed = False
        self._send = send

    def send(self, frame: Frame) -> None:
        """Send a frame, unless the client has left."""
        if not self.is_closed:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], compression: str = "none") -> None:
        """Send an operation; fields that are None are left out."""
        self.send(encode({name: value for name, value in fields.items() if value is not None}, compression))

    def report(self, level: Level, text: str, number: RequestId = None) -> None:
        """Send a status message about the operation with this id, if the client wants messages of this level."""
        if LEVELS.index(level) <= LEVELS.index(self.level):
            self.answer({"op": "status", "id": number, "level": level, "msg": text})
