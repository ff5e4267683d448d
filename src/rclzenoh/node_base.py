"""The part of a node that its endpoints and its executor use: names, session, clock, log and mailbox."""

from __future__ import annotations

from typing import Any

from rclzenoh.context import Context, get_default_context
from rclzenoh.exceptions import NotInitializedException
from rclzenoh.keys import EntityKind, Token
from rclzenoh.logging import Logger
from rclzenoh.mailbox import Mailbox
from rclzenoh.names import absolute_namespace, check_node_name, join, resolve
from rclzenoh.time import ROSClock, Timer


class NodeBase:
    """A node as its endpoints and its executor see it.

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
            namespace=self._namespace,
            node=self._name,
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
