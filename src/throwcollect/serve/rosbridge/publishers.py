"""Topics that one client publishes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.belongings import Belongings
from throwcollect.serve.rosbridge.guarded import open_topic
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest

_DEPTH = 100
_HEADER = "std_msgs/Header"


@dataclass
class Advertised:
    """A topic that a client publishes.

    Attributes:
        client: The client.
        topic: Absolute name of the topic.
        type_name: Full name of its type.
        latched: Whether subscribers that join late get the last message.
        depth: Messages that are kept for slow subscribers.
        publisher: The publisher; None while there is no session.
    """

    client: Peer
    topic: str
    type_name: str
    latched: bool
    depth: int
    publisher: ros.Publisher | None = None

    def open(self) -> None:
        """Announce the topic."""
        qos = ros.QoSProfile(depth=1 if self.latched else self.depth)
        if self.latched:
            qos.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
        message_type = ros.get_message(self.type_name)
        self.publisher = self.client.host.session.node.create_publisher(message_type, self.topic, qos)

    def lose(self) -> None:
        """Forget the session, which has ended."""
        self.publisher = None

    def close(self) -> None:
        """Withdraw the topic."""
        if self.publisher is not None:
            self.client.host.session.node.destroy_publisher(self.publisher)


class Publishers(Belongings[Advertised]):
    """All topics that a client publishes."""

    def advertise(self, request: BridgeRequest) -> None:
        """Announce a topic."""
        self._advertise(open_topic(request.text("topic")), request, request.text("type"))

    def unadvertise(self, request: BridgeRequest) -> None:
        """Withdraw a topic."""
        topic = open_topic(request.text("topic"))
        advertised = self._by_name.pop(topic, None)
        if advertised is None:
            self._client.say("warning", f"unadvertise: {topic} is not advertised", request.id)
        else:
            advertised.close()

    def publish(self, request: BridgeRequest) -> None:
        """Publish a message; a topic that the client has not announced, but others have, is announced first."""
        topic = open_topic(request.text("topic"))
        advertised = self._by_name.get(topic) or self._advertise(topic, request, request.text_or("type", ""))
        message = ros.get_message(advertised.type_name)()
        values = request.any("msg")
        self._stamp(message, values)
        fill(message, {} if values is None else values)
        if advertised.publisher is not None:
            try:
                advertised.publisher.publish(message)
            except ValueError as error:
                raise ConfigError(f"publish: {error}") from error

    def _advertise(self, topic: str, request: BridgeRequest, wanted: str) -> Advertised:
        type_name = self._client.host.session.type_of(topic, wanted)
        known = self._by_name.get(topic)
        if known is not None:
            if known.type_name != type_name:
                raise ConfigError(f"{topic} is advertised as {known.type_name} already", expected="that type")
            return known
        depth = request.natural_or("queue_size", _DEPTH) or _DEPTH
        advertised = Advertised(self._client, topic, type_name, request.flag("latch"), depth)
        advertised.open()
        self._by_name[topic] = advertised
        return advertised

    def _stamp(self, message: Any, values: object) -> None:
        """Set the stamp of the header to the present time; `fill` replaces it if the client has one."""
        if message.get_fields_and_field_types().get("header") == _HEADER and isinstance(values, Mapping):
            message.header.stamp = self._client.host.session.node.get_clock().now().to_msg()
