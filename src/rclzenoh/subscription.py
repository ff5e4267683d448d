"""Subscriptions."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from rclzenoh.endpoint import Endpoint, unpack
from rclzenoh.interfaces import Message, deserialize
from rclzenoh.keys import EntityKind
from rclzenoh.mailbox import Receiver
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile
from rclzenoh.task import call


class Subscription(Receiver):
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
        super().__init__(node.mailbox, qos_profile.queue_length)
        self.msg_type = msg_type
        self.qos_profile = qos_profile
        self.raw = raw
        self.callback = callback
        # As in rclpy, a callback whose second argument is optional gets the message alone.
        self._wants_info = _takes(callback, 2) and not _takes(callback, 1)
        self._endpoint = Endpoint(node, EntityKind.SUBSCRIPTION, topic, msg_type.TYPE, qos_profile)
        # `handle` may be called with earlier messages before `_declare` returns, so it must not use anything set below.
        self._endpoint.announce(self._declare())

    def _declare(self) -> Any:
        session, key = self._endpoint.session, self._endpoint.key
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

    @property
    def topic_name(self) -> str:
        """Absolute name of the topic."""
        return self._endpoint.name

    def handle(self, item: zenoh.Sample) -> None:
        """Decode a sample and call back."""
        try:
            self._endpoint.check_key(item.encoding)
            attachment = unpack(item.attachment.to_bytes() if item.attachment is not None else b"")
            data = item.payload.to_bytes()
            message = data if self.raw else deserialize(data, self.msg_type)
        except ValueError as error:
            self._endpoint.complain(error)
            return
        if not self._wants_info:
            call(self.mailbox, self.callback, message)
            return
        info = {
            "source_timestamp": attachment.source_timestamp,
            "received_timestamp": time.time_ns(),
            "publication_sequence_number": attachment.sequence,
            "reception_sequence_number": None,
        }
        call(self.mailbox, self.callback, message, info)

    def destroy(self) -> None:
        """Withdraw the subscription; see `Node.destroy_subscription`."""
        self._endpoint.close()
        self.discard_all()


def _takes(callback: Callable[..., Any], count: int) -> bool:
    try:
        inspect.signature(callback).bind(*range(count))
    except TypeError:
        return False
    return True
