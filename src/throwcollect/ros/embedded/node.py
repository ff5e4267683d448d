"""Nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from throwcollect.interfaces import Message, get_message
from throwcollect.interfaces import Service as ServiceType
from throwcollect.ros.embedded.client import Client
from throwcollect.ros.embedded.clock import ROSClock
from throwcollect.ros.embedded.context import Context, get_default_context
from throwcollect.ros.embedded.duration import S_TO_NS
from throwcollect.ros.embedded.exceptions import InvalidHandle, NotInitializedException
from throwcollect.ros.embedded.executors import Executor
from throwcollect.ros.embedded.keys import EntityKind, Token
from throwcollect.ros.embedded.logging import Logger, LogRecord
from throwcollect.ros.embedded.mailbox import Mailbox
from throwcollect.ros.embedded.names import absolute_namespace, check_node_name, join, resolve
from throwcollect.ros.embedded.node_graph import NodeGraph
from throwcollect.ros.embedded.node_parameters import NodeParameters
from throwcollect.ros.embedded.parameter_service import ParameterService
from throwcollect.ros.embedded.publisher import Publisher
from throwcollect.ros.embedded.qos import (
    QoSProfile,
    qos_profile_parameter_events,
    qos_profile_rosout,
    qos_profile_services_default,
)
from throwcollect.ros.embedded.service import Service
from throwcollect.ros.embedded.subscription import Subscription
from throwcollect.ros.embedded.time import Time
from throwcollect.ros.embedded.time_source import TimeSource
from throwcollect.ros.embedded.timer import Timer

_ParameterEvent = get_message("rcl_interfaces/msg/ParameterEvent")
_Log = get_message("rcl_interfaces/msg/Log")


_E = TypeVar("_E", Publisher, Subscription, Service, Client)


class Node(NodeParameters, NodeGraph):
    """A node of the ROS graph.

    Args:
        node_name: Name of the node.
        context: Context; None for the default one.
        namespace: Namespace of the node and its relative names.
        enable_rosout: Whether what the node logs is published on ``/rosout``.
        start_parameter_services: Whether other nodes may read and change the parameters.

    Raises:
        NotInitializedException: If the context is not initialised.
        NameValidationException: If the name or namespace is invalid.
    """

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        namespace: str | None = None,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
    ) -> None:
        NodeGraph.__init__(self, context or get_default_context())
        NodeParameters.__init__(self, self._publish_parameter_event)
        if not self.context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}: init() has not been called")
        check_node_name(node_name)
        self._name, self._namespace = node_name, absolute_namespace(namespace or "")
        self.executor: Executor | None = None
        self.mailbox = Mailbox()
        self.timers: list[Timer] = []
        self._entities: list[Publisher | Subscription | Service | Client] = []
        self._clock = ROSClock()
        is_taken = (node_name, self._namespace) in self.get_node_names_and_namespaces()
        self.token, self._declared_token = self._declare_token()
        rosout = self.create_publisher(_Log, "/rosout", qos_profile_rosout) if enable_rosout else None
        self._rosout = rosout
        name = self.get_fully_qualified_name().strip("/").replace("/", ".")
        self._logger = Logger(name, self._publish_log if enable_rosout else None)
        self._parameter_events = self.create_publisher(
            _ParameterEvent, "/parameter_events", qos_profile_parameter_events
        )
        self._time_source = TimeSource(self, self._clock)
        if start_parameter_services:
            ParameterService(self)
        if is_taken:
            self._logger.warning(
                f"there is another node {self.get_fully_qualified_name()}: both work, but whoever calls one by its "
                "name, to set a parameter for example, calls both"
            )

    def _declare_token(self) -> tuple[Token, Any]:
        number = self.context.next_id()
        session = self.context.session
        token = Token(
            domain=self.context.get_domain_id(),
            session=str(session.zid()),
            node_id=number,
            entity_id=number,
            kind=EntityKind.NODE,
            namespace=self._namespace,
            node=self._name,
        )
        return token, session.liveliness().declare_token(token.key())

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

    def create_publisher(self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int) -> Publisher:
        """Publisher of a topic.

        Args:
            msg_type: Class of the messages.
            topic: Name of the topic.
            qos_profile: Quality of service, or its depth.

        Returns:
            The publisher.

        Raises:
            NameValidationException: If the name is invalid.
        """
        return self._keep(Publisher(self, msg_type, topic, _profile(qos_profile)))

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Subscription to a topic.

        Args:
            msg_type: Class of the messages.
            topic: Name of the topic.
            callback: Called with the message or, if it takes two arguments, with the message and a dictionary that says
                when it was sent; may be a coroutine function.
            qos_profile: Quality of service, or its depth.
            raw: Whether the callback gets the CDR bytes instead of a message.

        Returns:
            The subscription.

        Raises:
            NameValidationException: If the name is invalid.
            RuntimeError: If the callback takes neither one argument nor two.
        """
        return self._keep(Subscription(self, msg_type, topic, callback, _profile(qos_profile), raw=raw))

    def create_service(
        self,
        srv_type: type[ServiceType],
        srv_name: str,
        callback: Callable[[Message, Message], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
    ) -> Service:
        """Service.

        Args:
            srv_type: Class of the service.
            srv_name: Name of the service.
            callback: Called with the request and an empty response, returns the response; may be a coroutine function.
            qos_profile: Quality of service.

        Returns:
            The service.

        Raises:
            NameValidationException: If the name is invalid.
        """
        return self._keep(Service(self, srv_type, srv_name, callback, qos_profile))

    def create_client(
        self,
        srv_type: type[ServiceType],
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
    ) -> Client:
        """Client of a service.

        Args:
            srv_type: Class of the service.
            srv_name: Name of the service.
            qos_profile: Quality of service.

        Returns:
            The client.

        Raises:
            NameValidationException: If the name is invalid.
        """
        return self._keep(Client(self, srv_type, srv_name, qos_profile))

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
    ) -> Timer:
        """Timer.

        Args:
            timer_period_sec: Period [s] of the node's clock, so that simulated time counts.
            callback: Called without arguments; may be a coroutine function.

        Returns:
            The timer.
        """
        period_ns = int(timer_period_sec * S_TO_NS)
        timer = Timer(callback, period_ns, self._clock)
        self.timers.append(timer)
        if self.executor is not None:
            self.executor.wake()
        return timer

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Withdraw a publisher; returns whether it was the node's."""
        return self._destroy(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Withdraw a subscription; returns whether it was the node's."""
        return self._destroy(subscription)

    def destroy_service(self, service: Service) -> bool:
        """Withdraw a service; returns whether it was the node's."""
        return self._destroy(service)

    def destroy_client(self, client: Client) -> bool:
        """Withdraw a client; returns whether it was the node's."""
        return self._destroy(client)

    def destroy_node(self) -> None:
        """Withdraw the node and all that it has."""
        if self.executor is not None:
            self.executor.remove_node(self)
        self.timers.clear()
        while self._entities:
            self._entities.pop().destroy()
        token, self._declared_token = self._declared_token, None
        if token is not None and self.context.is_open():
            token.undeclare()

    def _keep(self, entity: _E) -> _E:
        self._entities.append(entity)
        return entity

    def _destroy(self, entity: Publisher | Subscription | Service | Client) -> bool:
        known = entity in self._entities
        if known:
            self._entities.remove(entity)
            entity.destroy()
        return known

    def _publish_parameter_event(self, event: Message) -> None:
        event.node = self.get_fully_qualified_name()
        event.stamp = self._clock.now().to_msg()
        self._parameter_events.publish(event)

    def _publish_log(self, record: LogRecord) -> None:
        if self._rosout is None:
            return
        message = _Log(
            stamp=Time(nanoseconds=record.stamp_ns).to_msg(),
            level=int(record.severity),
            name=record.name,
            msg=record.text,
            file=record.file,
            function=record.function,
            line=record.line,
        )
        try:
            self._rosout.publish(message)
        except InvalidHandle:
            self._rosout = None  # The node or its session ended; standard error has the message.


def create_node(node_name: str, **options: Any) -> Node:
    """Make a node.

    Args:
        node_name: Name of the node.
        options: Those of `Node`.

    Returns:
        The node.
    """
    return Node(node_name, **options)


def _profile(qos: QoSProfile | int) -> QoSProfile:
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
