"""The source of a node's ROS time: the topic ``/clock`` while the parameter ``use_sim_time`` is true."""

from __future__ import annotations

from rclzenoh.interfaces.msg import Clock
from rclzenoh.node_endpoints import NodeEndpoints
from rclzenoh.node_parameters import NodeParameters
from rclzenoh.parameter import Parameter
from rclzenoh.qos import QoSProfile, ReliabilityPolicy
from rclzenoh.subscription import Subscription
from rclzenoh.time import Time

CLOCK_TOPIC = "/clock"
USE_SIM_TIME = "use_sim_time"


class TimeSource:
    """Sets the clock of a node, which has these parameters."""

    def __init__(self, node: NodeEndpoints, parameters: NodeParameters) -> None:
        self._node = node
        self._clock = node.get_clock()
        self._subscription: Subscription | None = None
        parameters.add_post_set_parameters_callback(self._on_parameters)
        parameters.declare_parameter(USE_SIM_TIME, False)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == USE_SIM_TIME:
                self._use_sim_time(bool(parameter.value))

    def _use_sim_time(self, active: bool) -> None:
        if active == (self._subscription is not None):
            # A node that sets its clock itself goes on if it is told what it does already.
            return
        self._clock.activate(active)
        if self._subscription is None:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._subscription = self._node.create_subscription(Clock, CLOCK_TOPIC, self._on_clock, qos)
        else:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _on_clock(self, message: Clock) -> None:
        self._clock.set_ros_time_override(Time.from_msg(message.clock))
