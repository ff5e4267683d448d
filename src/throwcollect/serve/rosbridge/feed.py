"""A subscription in ROS whose messages go to all clients that listen; each message is encoded once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from throwcollect import ros
from throwcollect.ros.graph_names import find_offered_qos
from throwcollect.serve.rosbridge.codec import Frame, encode, plain_values
from throwcollect.units import NS_PER_S


class Sample:
    """One message of a topic, as it came: ``data`` in CDR, with the time of receipt on the node's clock [ns]."""

    def __init__(self, data: bytes, message_type: Any, received_ns: int) -> None:
        self.data = data
        self._type = message_type
        self._received_ns = received_ns
        self._frames: dict[tuple[str, str], Frame] = {}

    def frame(self, topic: str, compression: str) -> Frame:
        """Encode the message for a client that knows the topic by this name."""
        # All clients with the same name and compression get the same frame, which is encoded once.
        key = topic, compression
        if key not in self._frames:
            if compression == "cbor-raw":
                secs, nsecs = divmod(self._received_ns, NS_PER_S)
                content: Any = {"secs": secs, "nsecs": nsecs, "bytes": self.data}
            else:
                content = plain_values(ros.deserialize_message(self.data, self._type), compression)
            self._frames[key] = encode({"op": "publish", "topic": topic, "msg": content}, compression)
        return self._frames[key]


Listener = Callable[[Sample], None]


class Feed:
    """Subscribes to a topic for all clients that listen to it; ``on_end`` is called when nobody listens any more.

    ``topic`` is the absolute name of the topic, and ``type_name`` the full name of its type.
    """

    def __init__(self, node: ros.Node, topic: str, type_name: str, on_end: Callable[[], object]) -> None:
        self._node = node
        self._topic = topic
        self._type = ros.get_message(type_name)
        self._on_end = on_end
        self._listeners: list[Listener] = []
        self._offered = self._find_offered()
        self._subscription: Any = None

    @property
    def is_latched(self) -> bool:
        """Whether a subscription that joins late gets earlier messages."""
        return self._offered.durability == ros.DurabilityPolicy.TRANSIENT_LOCAL

    def add(self, listener: Listener) -> None:
        """Give the samples to one more listener."""
        self._listeners.append(listener)
        if self._subscription is None:
            self._subscribe()

    def remove(self, listener: Listener) -> None:
        """Stop giving the samples to a listener."""
        self._listeners.remove(listener)
        if not self._listeners:
            self._node.destroy_subscription(self._subscription)
            self._on_end()

    def renew(self) -> None:
        """Subscribe again if publishers offer another quality of service by now."""
        offered = self._find_offered()
        if _read_terms(offered) != _read_terms(self._offered):
            self._node.destroy_subscription(self._subscription)
            self._offered = offered
            self._subscribe()

    def _find_offered(self) -> ros.QoSProfile:
        # Without publishers, this assumes reliable ones, as most are: if one comes, the subscription need not be
        # renewed, and misses nothing.
        return find_offered_qos(self._node, self._topic, ros.ReliabilityPolicy.RELIABLE)

    def _subscribe(self) -> None:
        self._subscription = self._node.create_subscription(
            self._type, self._topic, self._hear, self._offered, raw=True
        )

    def _hear(self, data: bytes) -> None:
        sample = Sample(bytes(data), self._type, self._node.get_clock().now().nanoseconds)
        for listener in list(self._listeners):
            listener(sample)


def _read_terms(qos: ros.QoSProfile) -> tuple[object, object]:
    return qos.reliability, qos.durability
