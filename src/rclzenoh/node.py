"""Nodes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from rclzenoh.context import Context
from rclzenoh.endpoint import Endpoint
from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces import AnyMessage, Message
from rclzenoh.interfaces import Service as ServiceType
from rclzenoh.interfaces.msg import Clock, Log, ParameterEvent
from rclzenoh.keys import EntityKind
from rclzenoh.node_base import NodeBase
from rclzenoh.node_parameters import NodeParameters
from rclzenoh.parameter import Parameter
from rclzenoh.qos import (
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_parameter_events,
    qos_profile_parameters,
    qos_profile_rosout,
    qos_profile_services_default,
)
from rclzenoh.service import Client, Service
from rclzenoh.time import S_TO_NS, Time, Timer
from rclzenoh.topic import Publisher, Subscription

_CLOCK_TOPIC = "/clock"
_USE_SIM_TIME = "use_sim_time"

_E = TypeVar("_E", bound=Endpoint)


class Node(NodeBase, NodeParameters):
    """A node of the ROS graph.

    Args:
        node_name: Name of the node.
        context: Context; None for the default one.
        namespace: Namespace of the node and its relative names.
        enable_rosout: Whether what the node logs is published on ``/rosout``.
        start_parameter_services: Whether other nodes may read and change the parameters.
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
        NodeBase.__init__(self, node_name, namespace or "", context)
        self._endpoints: list[Endpoint] = []
        NodeParameters.__init__(self, self._publish_parameter_event)
        # This looks at the graph before the token of this node is declared, because then this node would be in it, too.
        is_taken = any(self.context.graph.tokens(EntityKind.NODE, node=(self._namespace, node_name)))
        self._declared_token: Any = self.context.session.liveliness().declare_token(self.token.key())
        if enable_rosout:
            self._rosout = self.create_publisher(Log, "/rosout", qos_profile_rosout)
            self._logger.sink = self._publish_log
        self._parameter_events = self.create_publisher(
            ParameterEvent, "/parameter_events", qos_profile_parameter_events
        )
        self._clock_subscription: Subscription | None = None
        self.add_post_set_parameters_callback(self._choose_clock)
        self.declare_parameter(_USE_SIM_TIME, False)
        if start_parameter_services:
            for service, name, field, find in self.parameter_services(self._logger.warning):
                answer = partial(_answer, field, find)
                self.create_service(service, f"~/{name}", answer, qos_profile=qos_profile_parameters)
        if is_taken:
            self._logger.warning(
                f"there is another node {self.get_fully_qualified_name()}: both work, but who calls one by its "
                "name, to set a parameter for example, calls both"
            )

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

        The callback may be a coroutine function. It gets the message, or with ``raw`` its CDR bytes.
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

    def create_client(self, srv_type: type[ServiceType], srv_name: str) -> Client:
        """Make a client of a service."""
        return self._keep(Client(self, srv_type, srv_name))

    def create_timer(self, timer_period_sec: float, callback: Callable[[], Any]) -> Timer:
        """Make a timer on the node's clock, so that simulated time counts; the callback may be a coroutine function."""
        timer = Timer(callback, int(timer_period_sec * S_TO_NS), self._clock)
        self.timers.append(timer)
        # A waiting executor does not know of this timer and may wait too long, so it is woken.
        self.mailbox.submit(None)
        return timer

    def _destroy(self, endpoint: Endpoint) -> bool:
        """Withdraw an endpoint; returns whether it belonged to this node."""
        known = endpoint in self._endpoints
        if known:
            self._endpoints.remove(endpoint)
            endpoint.destroy()
        return known

    destroy_publisher = destroy_subscription = destroy_service = destroy_client = _destroy

    def _keep(self, endpoint: _E) -> _E:
        self._endpoints.append(endpoint)
        return endpoint

    def destroy_node(self) -> None:
        """Withdraw the node and all of its endpoints."""
        if self.executor is not None:
            self.executor.remove_node(self)
        self.timers.clear()
        while self._endpoints:
            self._endpoints.pop().destroy()
        token, self._declared_token = self._declared_token, None
        if token is not None and self.context.ok():
            token.undeclare()

    def _publish_parameter_event(self, event: ParameterEvent) -> None:
        event.node = self.get_fully_qualified_name()
        event.stamp = self._clock.now().to_msg()
        self._parameter_events.publish(event)

    def _publish_log(self, message: Log) -> None:
        try:
            self._rosout.publish(message)
        except InvalidHandle:
            self._logger.sink = None  # The node or its session has ended; standard error has the message anyway.

    def _choose_clock(self, parameters: list[Parameter]) -> None:
        """Set the clock by the topic ``/clock`` while the parameter ``use_sim_time`` is true."""
        for parameter in parameters:
            active = bool(parameter.value)
            # A node that sets its clock itself goes on if it is asked for what it does already.
            if parameter.name != _USE_SIM_TIME or active == (self._clock_subscription is not None):
                continue
            self._clock.activate(active)
            if self._clock_subscription is None:
                qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
                self._clock_subscription = self.create_subscription(Clock, _CLOCK_TOPIC, self._take_clock, qos)
            else:
                self.destroy_subscription(self._clock_subscription)
                self._clock_subscription = None

    def _take_clock(self, message: Clock) -> None:
        self._clock.set_ros_time_override(Time.from_msg(message.clock))


def _answer(field: str, find: Callable[[AnyMessage], object], request: AnyMessage, response: AnyMessage) -> AnyMessage:
    """Answer a request by one field of the response."""
    setattr(response, field, find(request))
    return response


def _make_profile(qos: QoSProfile | int) -> QoSProfile:
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)
