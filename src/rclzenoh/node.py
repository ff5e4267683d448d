"""Nodes."""

from __future__ import annotations

from typing import Any

from rclzenoh.context import Context
from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces.msg import Clock, Log, ParameterEvent
from rclzenoh.keys import EntityKind
from rclzenoh.node_endpoints import NodeEndpoints
from rclzenoh.node_parameters import NodeParameters, offer_parameters
from rclzenoh.parameter import Parameter
from rclzenoh.qos import QoSProfile, ReliabilityPolicy, qos_profile_parameter_events, qos_profile_rosout
from rclzenoh.time import Time
from rclzenoh.topic import Subscription

_CLOCK_TOPIC = "/clock"
_USE_SIM_TIME = "use_sim_time"


class Node(NodeEndpoints, NodeParameters):
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
        NodeEndpoints.__init__(self, node_name, namespace or "", context)
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
            offer_parameters(self, self)
        if is_taken:
            self._logger.warning(
                f"there is another node {self.get_fully_qualified_name()}: both work, but who calls one by its "
                "name, to set a parameter for example, calls both"
            )

    def destroy_node(self) -> None:
        """Withdraw the node and all of its endpoints."""
        if self.executor is not None:
            self.executor.remove_node(self)
        self.destroy_endpoints()
        token, self._declared_token = self._declared_token, None
        if token is not None and self.context.is_open():
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
