"""How a node makes its publishers, subscriptions, services, clients and timers, and withdraws them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rclzenoh.context import Context
from rclzenoh.endpoint import Endpoint
from rclzenoh.interfaces import Message
from rclzenoh.interfaces import Service as ServiceType
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile, qos_profile_services_default
from rclzenoh.service import Client, Service
from rclzenoh.time import S_TO_NS, Timer
from rclzenoh.topic import Publisher, Subscription

_E = TypeVar("_E", bound=Endpoint)


class NodeEndpoints(NodeBase):
    """A node that makes endpoints and withdraws them; arguments and errors as those of `NodeBase`."""

    def __init__(self, node_name: str, namespace: str, context: Context | None) -> None:
        super().__init__(node_name, namespace, context)
        self._entities: list[Endpoint] = []

    def create_publisher(self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int) -> Publisher:
        """Make a publisher, with a profile or only a depth."""
        return self._keep(Publisher(self, msg_type, topic, _make_profile(qos_profile)))

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Make a subscription, with a profile or only a depth.

        The callback may be a coroutine function. It gets the message (with ``raw`` its CDR bytes) and, if it takes two
        arguments, a dictionary with the time at which the message was sent.
        """
        return self._keep(Subscription(self, msg_type, topic, callback, _make_profile(qos_profile), raw=raw))

    def create_service(
        self,
        srv_type: type[ServiceType],
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
    ) -> Service:
        """Make a service.

        The callback gets the request and an empty response, and returns the response; it may be a coroutine function.
        """
        return self._keep(Service(self, srv_type, srv_name, callback, qos_profile))

    def create_client(
        self,
        srv_type: type[ServiceType],
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
    ) -> Client:
        """Make a client of a service."""
        return self._keep(Client(self, srv_type, srv_name, qos_profile))

    def create_timer(self, timer_period_sec: float, callback: Callable[[], Any]) -> Timer:
        """Make a timer on the node's clock, so that simulated time counts; the callback may be a coroutine function."""
        timer = Timer(callback, int(timer_period_sec * S_TO_NS), self._clock)
        self.timers.append(timer)
        # A waiting executor does not know of this timer and may wait too long, so it is woken.
        self.mailbox.submit(None)
        return timer

    def _destroy(self, entity: Endpoint) -> bool:
        """Withdraw an endpoint; returns whether it belonged to this node."""
        known = entity in self._entities
        if known:
            self._entities.remove(entity)
            entity.destroy()
        return known

    destroy_publisher = destroy_subscription = destroy_service = destroy_client = _destroy

    def destroy_endpoints(self) -> None:
        """Withdraw all endpoints and timers."""
        self.timers.clear()
        while self._entities:
            self._entities.pop().destroy()

    def _keep(self, entity: _E) -> _E:
        self._entities.append(entity)
        return entity


def _make_profile(qos: QoSProfile | int) -> QoSProfile:
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
