"""The genuine rclpy, whatever RMW it uses, where it is installed."""

from __future__ import annotations

import itertools

import rclpy
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy import (
    create_node,
    get_global_executor,
    ok,
    shutdown,
    spin,
    spin_once,
    spin_until_future_complete,
    try_shutdown,
)
from rclpy.action import (
    ActionClient,
    ActionServer,
    CancelResponse,
    GoalResponse,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future, Task
from rclpy.time import Time
from rclpy.utilities import get_default_context
from rosidl_runtime_py.utilities import get_action, get_message, get_service

from throwcollect.errors import ThrowcollectError
from throwcollect.session_config import is_protected

_looks = itertools.count()


def init(args: list[str] | None = None, *, context: Context | None = None, domain_id: int | None = None) -> None:
    """Initialise a context, as ``rclpy.init`` does but for signals: they are left to whoever handles them.

    rclpy's own handlers would take the context away from nodes that still have to finish something.

    Args:
        args: Command line arguments.
        context: The context; None for the default one.
        domain_id: Domain identifier; None takes ``ROS_DOMAIN_ID``, or 0.

    Raises:
        RuntimeError: If the context is in use already.
        ThrowcollectError: If the RMW does not start, as rmw_zenoh_cpp does not without a router.
    """
    try:
        rclpy.init(args=args, context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:
        raise ThrowcollectError(f"ROS 2 does not start: {error}") from error


def graph_changes(_node: Node) -> int:
    """A number that differs from what it was before whenever the ROS graph has changed in between.

    rclpy does not tell of changes, so there may always have been one.
    """
    return next(_looks)


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that lets nobody in without a key: other RMWs know of no key.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    return rclpy.get_rmw_implementation_identifier() == "rmw_zenoh_cpp" and is_protected()


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows what ``set_ros_time_override`` was last given."""
    # As rclpy's own time source does it; there is no public way.
    node.get_clock()._set_ros_time_is_active(True)


__all__ = [
    "ActionClient",
    "ActionServer",
    "CancelResponse",
    "Clock",
    "ClockType",
    "Context",
    "DurabilityPolicy",
    "Duration",
    "Executor",
    "ExternalShutdownException",
    "Future",
    "GoalResponse",
    "HistoryPolicy",
    "IntegerRange",
    "Node",
    "Parameter",
    "ParameterDescriptor",
    "Publisher",
    "QoSProfile",
    "ROSClock",
    "ReliabilityPolicy",
    "SetParametersResult",
    "SingleThreadedExecutor",
    "Task",
    "Time",
    "create_node",
    "get_action",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
    "get_default_context",
    "get_global_executor",
    "get_message",
    "get_service",
    "graph_changes",
    "init",
    "joins_protected",
    "ok",
    "provide_time",
    "shutdown",
    "spin",
    "spin_once",
    "spin_until_future_complete",
    "try_shutdown",
]
