"""What endpoints and executors know of their node: names, session, clock, log, and where its work waits."""

from __future__ import annotations

from typing import Protocol

from rclzenoh.clock import ROSClock
from rclzenoh.context import Context, get_default_context
from rclzenoh.exceptions import NotInitializedException
from rclzenoh.keys import EntityKind, Token
from rclzenoh.logging import Logger
from rclzenoh.mailbox import Mailbox
from rclzenoh.names import absolute_namespace, check_node_name, join, resolve
from rclzenoh.timer import Timer


class NodeKeeper(Protocol):
    """What a node knows of the executor that it is in."""

    def remove_node(self, node: NodeBase) -> None:
        """Stop taking care of a node's callbacks."""


class NodeBase:
    """A node as its endpoints and its executor see it.

    Args:
        node_name: Name of the node.
        namespace: Namespace of the node and its relative names.
        context: Context; None for the default one.

    Attributes:
        context: Context of the node.
        executor: Executor that takes care of the node's callbacks.
        mailbox: Where work of the node waits for its executor.
        timers: Timers of the node.
        token: Token that announces the node.

    Raises:
        NotInitializedException: If the context is not initialised.
        NameValidationException: If the name or namespace is invalid.
    """

    def __init__(self, node_name: str, namespace: str, context: Context | None) -> None:
        self.context = context or get_default_context()
        if not self.context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}: init() has not been called")
        check_node_name(node_name)
        self._name, self._namespace = node_name, absolute_namespace(namespace)
        self.executor: NodeKeeper | None = None
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
        """Absolute name of a topic.

        Args:
            topic: Absolute (``/x``), relative (``x``) or private (``~/x``) name.

        Returns:
            The absolute name.

        Raises:
            NameValidationException: If it is no valid name.
        """
        return resolve(topic, self._namespace, self._name)
