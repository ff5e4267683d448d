"""What one client publishes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.values import fill
from throwcollect.serve.rosbridge.guarded import open_topic
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import Request

_DEPTH = 100
_LONGEST_QUEUE = 10_000
_HEADER = "std_msgs/Header"


@dataclass
class Advertised:
    """A topic that a client publishes.

    Attributes:
        topic: Its absolute name.
        type_name: Full name of its type.
        latched: Whether who joins late gets the last message.
        depth: Messages that are kept for who is slow.
        publisher: The publisher; None while there is no session.
    """

    topic: str
    type_name: str
    latched: bool
    depth: int
    publisher: ros.Publisher | None = None

    def open(self, node: ros.Node) -> None:
        """Announce the topic."""
        qos = ros.QoSProfile(depth=1 if self.latched else self.depth)
        if self.latched:
            qos.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
        self.publisher = node.create_publisher(ros.get_message(self.type_name), self.topic, qos)


class Publishers:
    """All topics that a client publishes.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._by_topic: dict[str, Advertised] = {}

    def advertise(self, request: Request) -> None:
        """Announce a topic.

        Raises:
            ConfigError: If it has another type, or nobody may publish it.
        """
        self._advertise(open_topic(request.text("topic")), request, request.text("type"))

    def unadvertise(self, request: Request) -> None:
        """Withdraw a topic.

        Raises:
            ConfigError: If its name is none.
        """
        topic = open_topic(request.text("topic"))
        advertised = self._by_topic.pop(topic, None)
        if advertised is None:
            self._client.say("warning", f"unadvertise: {topic} is not advertised", request.id)
        elif advertised.publisher is not None:
            self._client.session.node.destroy_publisher(advertised.publisher)

    def publish(self, request: Request) -> None:
        """Publish a message; the topic is announced if it is there, and the client has not announced it.

        Raises:
            ConfigError: If nobody has announced the topic, nobody may publish it, or the message is not of its type.
        """
        topic = open_topic(request.text("topic"))
        advertised = self._by_topic.get(topic) or self._advertise(topic, request, request.text_or("type", ""))
        message = ros.get_message(advertised.type_name)()
        values = request.any("msg")
        self._stamp(message, values)
        fill(message, {} if values is None else values)
        if advertised.publisher is not None:
            try:
                advertised.publisher.publish(message)
            except ValueError as error:
                raise ConfigError(f"publish: {error}") from error

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        for advertised in self._by_topic.values():
            advertised.publisher = None

    def restore(self) -> None:
        """Announce everything again, in a new session."""
        for advertised in self._by_topic.values():
            advertised.open(self._client.session.node)

    def close(self) -> None:
        """Withdraw everything."""
        for advertised in self._by_topic.values():
            if advertised.publisher is not None:
                self._client.session.node.destroy_publisher(advertised.publisher)
        self._by_topic.clear()

    def _advertise(self, topic: str, request: Request, wanted: str) -> Advertised:
        type_name = self._client.session.type_of(topic, wanted)
        known = self._by_topic.get(topic)
        if known is not None:
            if known.type_name != type_name:
                raise ConfigError(f"{topic} is advertised as {known.type_name} already", expected="that type")
            return known
        depth = min(request.natural_or("queue_size", _DEPTH) or _DEPTH, _LONGEST_QUEUE)
        advertised = Advertised(topic, type_name, request.flag("latch"), depth)
        advertised.open(self._client.session.node)
        self._by_topic[topic] = advertised
        return advertised

    def _stamp(self, message: Any, values: object) -> None:
        """Give the header of a message the present time, should the client have left that out."""
        if message.get_fields_and_field_types().get("header") == _HEADER and isinstance(values, Mapping):
            message.header.stamp = self._client.session.node.get_clock().now().to_msg()
