"""The ROS 2 edge: nodes by the API of rclpy, over Zenoh as rmw_zenoh_cpp speaks it, without a ROS installation."""

from throwcollect.ros.clock import Clock, ROSClock
from throwcollect.ros.context import Context, get_default_context, init, ok, shutdown, try_shutdown
from throwcollect.ros.duration import Duration
from throwcollect.ros.exceptions import ExternalShutdownException
from throwcollect.ros.executors import Executor, SingleThreadedExecutor
from throwcollect.ros.node import Node, create_node
from throwcollect.ros.parameter import Parameter, ParameterDescriptor, SetParametersResult
from throwcollect.ros.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from throwcollect.ros.spinning import get_global_executor, spin, spin_once, spin_until_future_complete
from throwcollect.ros.task import Future, Task
from throwcollect.ros.time import ClockType, Time

__all__ = [
    "Clock",
    "ClockType",
    "Context",
    "DurabilityPolicy",
    "Duration",
    "Executor",
    "ExternalShutdownException",
    "Future",
    "HistoryPolicy",
    "Node",
    "Parameter",
    "ParameterDescriptor",
    "QoSProfile",
    "ROSClock",
    "ReliabilityPolicy",
    "SetParametersResult",
    "SingleThreadedExecutor",
    "Task",
    "Time",
    "create_node",
    "get_default_context",
    "get_global_executor",
    "init",
    "ok",
    "shutdown",
    "spin",
    "spin_once",
    "spin_until_future_complete",
    "try_shutdown",
]
