"""Publishers and subscriptions."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.ext import (
    CacheConfig,
    HistoryConfig,
    MissDetectionConfig,
    RecoveryConfig,
    declare_advanced_publisher,
    declare_advanced_subscriber,
)

from rclzenoh.endpoint import Attachment, Endpoint, unpack
from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces import Message, deserialize, serialize
from rclzenoh.keys import EntityKind
from rclzenoh.mailbox import Receiver
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import HistoryPolicy, QoSProfile
from rclzenoh.task import call

HEARTBEAT_S = 0.5
"""Period [s] in which rmw_zenoh_cpp announces the last sample of a reliable, transient local topic."""


class Publisher(Endpoint):
    """Publishes messages on a topic. Made by `Node.create_publisher`."""

    def __init__(self, node: NodeBase, msg_type: type[Message], topic: str, qos_profile: QoSProfile) -> None:
        super().__init__(node, EntityKind.PUBLISHER, topic, msg_type.TYPE, qos_profile)
        self.topic_name = self.name
        self.msg_type = msg_type
        self._sequence = 0
        # Genuine subscribers drop samples that arrive out of order, so one lock covers numbering and sending.
        self._lock = threading.Lock()
        self.announce(_declare(self))

    def publish(self, msg: Message | bytes) -> None:
        """Publish a message, or its CDR bytes."""
        if isinstance(msg, self.msg_type):
            data = serialize(msg)
        elif isinstance(msg, bytes):
            data = msg
        else:
            raise TypeError(f"{self.topic_name}: expected {self.msg_type.TYPE} or bytes, got {type(msg).__name__}")
        with self._lock:
            # Another thread may destroy the publisher meanwhile; Zenoh then refuses to send.
            if (publisher := self.declared) is None:
                raise InvalidHandle(f"{self.topic_name}: the publisher was destroyed")
            self._sequence += 1
            attachment = Attachment(self._sequence, time.time_ns(), self.gid).pack()
            try:
                publisher.put(data, attachment=attachment)
            except zenoh.ZError as error:
                raise self.invalid(error) from error

    def get_subscription_count(self) -> int:
        """Number of subscriptions to the topic in the whole graph; asking again costs a microsecond or two."""
        return self.node.context.graph.count(EntityKind.SUBSCRIPTION, self.name, self.type)


def _declare(endpoint: Endpoint) -> Any:
    qos = endpoint.qos_profile
    # As in rmw_zenoh_cpp, only a reliable topic that keeps all messages waits for slow subscribers.
    keeps_all = qos.is_reliable and qos.history is HistoryPolicy.KEEP_ALL
    congestion = zenoh.CongestionControl.BLOCK if keeps_all else zenoh.CongestionControl.DROP
    reliability = zenoh.Reliability.RELIABLE if qos.is_reliable else zenoh.Reliability.BEST_EFFORT
    options: Any = {"encoding": endpoint.encoding, "congestion_control": congestion, "reliability": reliability}
    if not qos.is_transient_local:
        return endpoint.session.declare_publisher(endpoint.key, **options)
    return declare_advanced_publisher(
        endpoint.session,
        endpoint.key,
        **options,
        # The number stands for no limit.
        cache=CacheConfig(max_samples=qos.queue_length or 2**31),
        # With this, subscribers that existed before notice the publisher, and ask for its earlier messages.
        publisher_detection=True,
        sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S)
        if qos.is_reliable
        else None,
    )


class Subscription(Endpoint, Receiver):
    """Calls back with the messages of a topic. Made by `Node.create_subscription`."""

    def __init__(
        self,
        node: NodeBase,
        msg_type: type[Message],
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile,
        *,
        raw: bool,
    ) -> None:
        Endpoint.__init__(self, node, EntityKind.SUBSCRIPTION, topic, msg_type.TYPE, qos_profile)
        Receiver.__init__(self, node.mailbox, qos_profile.queue_length)
        self.topic_name = self.name
        self.msg_type = msg_type
        self.raw = raw
        self.callback = callback
        # `handle` may be called with earlier messages before `_declare` returns, so it must not use anything set below.
        self.announce(self._declare())

    def _declare(self) -> Any:
        session, key = self.session, self.key
        handler = zenoh.handlers.Callback(self.deliver, indirect=False)
        if not self.qos_profile.is_transient_local:
            return session.declare_subscriber(key, handler)
        return declare_advanced_subscriber(
            session,
            key,
            handler,
            history=HistoryConfig(detect_late_publishers=True, max_samples=self.qos_profile.queue_length),
            recovery=RecoveryConfig(periodic_queries=None, heartbeat=True) if self.qos_profile.is_reliable else None,
            subscriber_detection=True,
        )

    def handle(self, item: zenoh.Sample) -> None:
        """Decode a sample and call back."""
        try:
            self.check_key(item.encoding)
            unpack(item.attachment)
            data = item.payload.to_bytes()
            message = data if self.raw else deserialize(data, self.msg_type)
        except ValueError as error:
            self.complain(error)
            return
        call(self.mailbox, self.callback, message)

    def destroy(self) -> None:
        """Withdraw the subscription; see `Node.destroy_subscription`."""
        super().destroy()
        self.take_all()
