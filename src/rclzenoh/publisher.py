"""Publishers."""

from __future__ import annotations

import threading
import time
from typing import Any

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from rclzenoh.endpoint import Attachment, Endpoint
from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces import Message, serialize
from rclzenoh.keys import EntityKind
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import HistoryPolicy, QoSProfile

HEARTBEAT_S = 0.5
"""Period [s] in which rmw_zenoh_cpp announces the last sample of a reliable, transient local topic."""


class Publisher:
    """Publishes messages on a topic. Made by `Node.create_publisher`."""

    def __init__(self, node: NodeBase, msg_type: type[Message], topic: str, qos_profile: QoSProfile) -> None:
        self.msg_type = msg_type
        self.qos_profile = qos_profile
        self._endpoint = Endpoint(node, EntityKind.PUBLISHER, topic, msg_type.TYPE, qos_profile)
        self._sequence = 0
        # Genuine subscribers drop samples that arrive out of order, so one lock covers numbering and sending.
        self._lock = threading.Lock()
        self._publisher: Any = _declare(self._endpoint, qos_profile)
        self._endpoint.announce(self._publisher)

    @property
    def topic_name(self) -> str:
        """Absolute name of the topic."""
        return self._endpoint.name

    def publish(self, msg: Message | bytes) -> None:
        """Publish a message, or its CDR bytes."""
        if isinstance(msg, self.msg_type):
            data = serialize(msg)
        elif isinstance(msg, bytes):
            data = msg
        else:
            raise TypeError(f"{self.topic_name}: expected {self.msg_type.TYPE} or bytes, got {type(msg).__name__}")
        with self._lock:
            if self._publisher is None:
                raise InvalidHandle(f"{self.topic_name}: the publisher was destroyed")
            self._sequence += 1
            attachment = Attachment(self._sequence, time.time_ns(), self._endpoint.gid).pack()
            try:
                self._publisher.put(data, attachment=attachment)
            except zenoh.ZError as error:
                raise self._endpoint.invalid(error) from error

    def get_subscription_count(self) -> int:
        """Number of subscriptions to the topic in the whole graph; asking costs a fraction of a microsecond."""
        endpoint = self._endpoint
        return endpoint.node.context.graph.count(EntityKind.SUBSCRIPTION, endpoint.name, endpoint.type)

    def destroy(self) -> None:
        """Withdraw the publisher; see `Node.destroy_publisher`."""
        with self._lock:
            self._publisher = None
        self._endpoint.close()


def _declare(endpoint: Endpoint, qos: QoSProfile) -> Any:
    # As in rmw_zenoh_cpp, only a reliable topic that keeps all messages waits for slow subscribers.
    keeps_all = qos.is_reliable and qos.history is HistoryPolicy.KEEP_ALL
    congestion = zenoh.CongestionControl.BLOCK if keeps_all else zenoh.CongestionControl.DROP
    reliability = zenoh.Reliability.RELIABLE if qos.is_reliable else zenoh.Reliability.BEST_EFFORT
    if not qos.is_transient_local:
        return endpoint.session.declare_publisher(
            endpoint.key, encoding=endpoint.encoding, congestion_control=congestion, reliability=reliability
        )
    return declare_advanced_publisher(
        endpoint.session,
        endpoint.key,
        encoding=endpoint.encoding,
        congestion_control=congestion,
        reliability=reliability,
        cache=CacheConfig(max_samples=qos.queue_length or _ENDLESS),
        # With this, subscribers that existed before notice the publisher, and ask for its earlier messages.
        publisher_detection=True,
        sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S)
        if qos.is_reliable
        else None,
    )


_ENDLESS = 2**31
"""Cache size that stands for no limit."""
