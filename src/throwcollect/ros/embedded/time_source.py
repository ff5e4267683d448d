"""Where a node's ROS time comes from: its parameter ``use_sim_time`` and the topic ``/clock``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from throwcollect.interfaces import Message, get_message
from throwcollect.ros.embedded.clock import ROSClock
from throwcollect.ros.embedded.parameter import Parameter
from throwcollect.ros.embedded.qos import QoSProfile, ReliabilityPolicy
from throwcollect.ros.embedded.subscription import Subscription
from throwcollect.ros.embedded.time import Time

if TYPE_CHECKING:
    from throwcollect.ros.embedded.node import Node

CLOCK_TOPIC = "/clock"
USE_SIM_TIME = "use_sim_time"


class TimeSource:
    """Sets a node's clock.

    Args:
        node: The node.
        clock: Its clock.
    """

    def __init__(self, node: Node, clock: ROSClock) -> None:
        self._node = node
        self._clock = clock
        self._subscription: Subscription | None = None
        node.add_post_set_parameters_callback(self._on_parameters)
        if node.has_parameter(USE_SIM_TIME):
            self._on_parameters([node.get_parameter(USE_SIM_TIME)])
        else:
            node.declare_parameter(USE_SIM_TIME, False)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == USE_SIM_TIME:
                self._use_sim_time(bool(parameter.value))

    def _use_sim_time(self, active: bool) -> None:
        self._clock.activate(active)
        if active and self._subscription is None:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            clock_type = get_message("rosgraph_msgs/msg/Clock")
            self._subscription = self._node.create_subscription(clock_type, CLOCK_TOPIC, self._on_clock, qos)
        elif not active and self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _on_clock(self, message: Message) -> None:
        self._clock.set_ros_time_override(Time.from_msg(message.clock))
