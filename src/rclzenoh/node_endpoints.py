"""The publishers, subscriptions, services, clients and timers of a node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rclzenoh.client import Client
from rclzenoh.context import Context
from rclzenoh.duration import S_TO_NS
from rclzenoh.interfaces import Message
from rclzenoh.interfaces import Service as ServiceType
from rclzenoh.node_base import NodeBase
from rclzenoh.publisher import Publisher
from rclzenoh.qos import QoSProfile, qos_profile_services_default
from rclzenoh.service import Service
from rclzenoh.subscription import Subscription
from rclzenoh.timer import Timer

_E = TypeVar("_E", Publisher, Subscription, Service, Client)


class NodeEndpoints(NodeBase):
    """A node that makes endpoints and withdraws them; arguments and errors as those of `NodeBase`."""

    def __init__(self, node_name: str, namespace: str, context: Context | None) -> None:
        super().__init__(node_name, namespace, context)
        self._entities: list[Publisher | Subscription | Service | Client] = []

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
        callback: Callable[[Any, Any], Any],
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
        self.mailbox.submit(None)
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

    def destroy_endpoints(self) -> None:
        """Withdraw all endpoints and timers."""
        self.timers.clear()
        while self._entities:
            self._entities.pop().destroy()

    def _keep(self, entity: _E) -> _E:
        self._entities.append(entity)
        return entity

    def _destroy(self, entity: Publisher | Subscription | Service | Client) -> bool:
        known = entity in self._entities
        if known:
            self._entities.remove(entity)
            entity.destroy()
        return known


def _profile(qos: QoSProfile | int) -> QoSProfile:
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
