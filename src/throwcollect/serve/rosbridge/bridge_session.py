"""A bridge's session in the ROS graph, while there is a router: a node, and all feeds and clients that are shared."""

from __future__ import annotations

from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.connection import Connection
from throwcollect.ros.graph_names import find_interface, full_name, make_own_name
from throwcollect.serve.rosbridge.feed import Feed, Listener


class BridgeSession:
    """A context, a hidden node in it, and the node's executor; all are used by one thread.

    Raises:
        ConfigError: If the connection cannot be used.
        ThrowcollectError: If there is no router.
    """

    def __init__(self, connection: Connection) -> None:
        self._context = ros.Context()
        ros.init(context=self._context, connection=connection)
        self.node = ros.Node(
            make_own_name(),
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        ros.let_callbacks_wait(self.node)
        self.executor = ros.SingleThreadedExecutor(context=self._context)
        self.executor.add_node(self.node)
        self._feeds: dict[tuple[str, str, object], Feed] = {}
        self._clients: dict[tuple[str, str], Any] = {}
        self._changes: int | None = None

    def close(self) -> None:
        """Leave the graph."""
        try:
            self.executor.shutdown()
            self.node.destroy_node()
        finally:
            ros.shutdown(context=self._context)

    def type_of(self, topic: str, wanted: str) -> str:
        """Full name of the type of a topic, which a client may name in full, as ``pkg/Type``, or not at all."""
        # Only the endpoints of this topic are asked for: a list of all topics, made for each of thousands of requests,
        # would keep all clients of the bridge waiting.
        endpoints = self.node.get_publishers_info_by_topic(topic) + self.node.get_subscriptions_info_by_topic(topic)
        types = sorted({each.topic_type for each in endpoints})
        if not wanted:
            if len(types) != 1:
                what = f"has {len(types)} types" if types else "is published by nobody, and no type is named"
                raise ConfigError(f"{topic} {what}", expected=f"one of {', '.join(types)}" if types else "a type")
            return types[0]
        name = full_name("msg", wanted)
        find_interface("msg", name)
        if types and name not in types:
            raise ConfigError(f"{topic} is no {name}", expected=", ".join(types))
        return name

    def listen(self, topic: str, type_name: str, listener: Listener) -> Feed:
        """Give the messages of a topic to a listener; a latched topic begins with its earlier messages."""
        # Earlier messages of a latched topic come only with a new subscription, so a later listener gets its own.
        alone = (topic, type_name, listener)
        shared = (topic, type_name, None)
        feed = self._feeds.get(shared)
        if feed is None or feed.is_latched:
            key = shared if feed is None else alone
            feed = self._feeds[key] = Feed(self.node, topic, type_name, lambda: self._feeds.pop(key, None))
        feed.add(listener)
        return feed

    def service_client(self, service: str, type_name: str) -> Any:
        """A client of a service, given by its absolute name; all clients of the bridge share it."""
        key = service, type_name
        if key not in self._clients:
            self._clients[key] = self.node.create_client(find_interface("srv", type_name), service)
        return self._clients[key]

    def is_offered_by_others(self, service: str) -> bool:
        """Whether another node than that of the bridge offers a service, given by its absolute name."""
        return any(
            service in dict(self.node.get_service_names_and_types_by_node(*other))
            for other in self.node.get_node_names_and_namespaces()
            if other[0] != self.node.get_name()
        )

    def look_around(self) -> None:
        """Subscribe again to topics whose publishers offer another quality of service by now."""
        changes = ros.graph_changes(self.node)
        if changes != self._changes:
            self._changes = changes
            for feed in list(self._feeds.values()):
                feed.renew()
