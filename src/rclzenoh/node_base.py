"""The part of a node that its endpoints and its executor use: names, session, clock, log, mailbox and graph."""

from __future__ import annotations

from typing import Any

from rclzenoh.context import Context, get_default_context
from rclzenoh.exceptions import NotInitializedException
from rclzenoh.keys import EntityKind, Token
from rclzenoh.logging import Logger
from rclzenoh.mailbox import Mailbox
from rclzenoh.names import absolute_namespace, check_node_name, join, resolve
from rclzenoh.time import ROSClock, Timer

NamesAndTypes = list[tuple[str, list[str]]]
"""Names of topics or services, each with its types."""


class NodeBase:
    """A node as its endpoints and its executor see it, and the graph as its context sees it, with hidden names.

    Attributes:
        mailbox: Where work of the node waits for its executor.
        token: Token that announces the node.
    """

    def __init__(self, node_name: str, namespace: str, context: Context | None) -> None:
        self.context = context or get_default_context()
        if not self.context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}: init() has not been called")
        check_node_name(node_name)
        self._name, self._namespace = node_name, absolute_namespace(namespace)
        self.executor: Any = None
        self.mailbox = Mailbox()
        self.timers: list[Timer] = []
        self._clock = ROSClock()
        self._logger = Logger(self.get_fully_qualified_name().strip("/").replace("/", "."))
        number = self.context.next_id()
        self.token = Token(
            domain=self.context.get_domain_id(),
            session=str(self.context.session.zid()),
            node_id=number,
            entity_id=number,
            kind=EntityKind.NODE,
            node_namespace=self._namespace,
            node_name=self._name,
        )

    def get_name(self) -> str:
        """Name without namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Absolute namespace."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """Absolute name."""
        return join(self._namespace, self._name)

    def get_clock(self) -> ROSClock:
        """Clock of the node: ROS time."""
        return self._clock

    def get_logger(self) -> Logger:
        """Logger of the node."""
        return self._logger

    def resolve_topic_name(self, topic: str) -> str:
        """Absolute name of a topic or service that is given as ``/x``, ``x`` or ``~/x``."""
        return resolve(topic, self._namespace, self._name)

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Names and namespaces of all nodes."""
        return sorted((token.node_name, token.node_namespace) for token in self.context.graph.tokens(EntityKind.NODE))

    def get_topic_names_and_types(self) -> NamesAndTypes:
        """All topics."""
        return self.context.graph.names_and_types(EntityKind.PUBLISHER, EntityKind.SUBSCRIPTION)

    def get_service_names_and_types(self) -> NamesAndTypes:
        """All services that are offered."""
        return self.context.graph.names_and_types(EntityKind.SERVICE)

    def get_publisher_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Topics that a node publishes."""
        return self.context.graph.names_and_types(EntityKind.PUBLISHER, node=(node_namespace, node_name))

    def get_subscriber_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Topics that a node subscribes to."""
        return self.context.graph.names_and_types(EntityKind.SUBSCRIPTION, node=(node_namespace, node_name))

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Services that a node offers."""
        return self.context.graph.names_and_types(EntityKind.SERVICE, node=(node_namespace, node_name))

    def count_publishers(self, topic_name: str) -> int:
        """Publishers of a topic, given by its absolute, relative or private name."""
        return self.context.graph.count(EntityKind.PUBLISHER, self.resolve_topic_name(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Subscriptions to a topic, given by its absolute, relative or private name."""
        return self.context.graph.count(EntityKind.SUBSCRIPTION, self.resolve_topic_name(topic_name))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[Token]:
        """All publishers of a topic, given by its absolute, relative or private name."""
        return list(self.context.graph.tokens(EntityKind.PUBLISHER, name=self.resolve_topic_name(topic_name)))

    def get_subscriptions_info_by_topic(self, topic_name: str) -> list[Token]:
        """All subscriptions to a topic, given by its absolute, relative or private name."""
        return list(self.context.graph.tokens(EntityKind.SUBSCRIPTION, name=self.resolve_topic_name(topic_name)))
