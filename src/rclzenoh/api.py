"""The names of rclpy's API that nodes use, and functions that it lacks and every backend offers.

`context.init` begins a session.
"""

from __future__ import annotations

import logging

from rclzenoh.action.client import (
    ActionClient,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclzenoh.action.server import ActionServer, CancelResponse, GoalResponse
from rclzenoh.context import Context, shutdown
from rclzenoh.exceptions import ExternalShutdownException, NameValidationException
from rclzenoh.executors import Executor, SingleThreadedExecutor
from rclzenoh.interfaces import deserialize as deserialize_message
from rclzenoh.interfaces import get_action, get_message, get_service
from rclzenoh.interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclzenoh.logging import LoggingSeverity
from rclzenoh.node import Node
from rclzenoh.parameter import Parameter, parameter_value_to_python
from rclzenoh.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclzenoh.task import Future
from rclzenoh.time import Time
from rclzenoh.topic import Publisher

__all__ = [
    "ActionClient",
    "ActionServer",
    "CancelResponse",
    "Context",
    "DurabilityPolicy",
    "Executor",
    "ExternalShutdownException",
    "FloatingPointRange",
    "Future",
    "GoalResponse",
    "HistoryPolicy",
    "IntegerRange",
    "NameValidationException",
    "Node",
    "Parameter",
    "ParameterDescriptor",
    "Publisher",
    "QoSProfile",
    "ReliabilityPolicy",
    "SetParametersResult",
    "SingleThreadedExecutor",
    "Time",
    "deserialize_message",
    "get_action",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
    "get_message",
    "get_service",
    "graph_changes",
    "let_callbacks_wait",
    "parameter_value_to_python",
    "pass_on_log",
    "provide_time",
    "shutdown",
    "spin_some",
    "stop_waiting",
]


def graph_changes(node: Node) -> int:
    """Return a number that differs from the last one if anything that was asked about the ROS graph has changed."""
    return node.context.graph.changes


def let_callbacks_wait(_node: Node) -> None:
    """Let a node go on with other callbacks while one of its coroutines waits; on this backend, all nodes do so."""


def pass_on_log(node: Node, record: logging.LogRecord) -> None:
    """Log a record of Python's own logging under a node's name and with the place that the record comes from."""
    place = (record.pathname, record.funcName or "", record.lineno)
    node.get_logger().log_from(place, record.getMessage(), LoggingSeverity(record.levelno))


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows the last ``set_ros_time_override``."""
    node.get_clock().activate(True)


def spin_some(executor: Executor, timeout_sec: float) -> None:
    """Wait for an input, then call the callbacks of all inputs that have arrived by then, but not of later ones."""
    executor.spin_once(timeout_sec)
    last = executor.create_task(_do_nothing)
    while not last.done():
        executor.spin_once(timeout_sec=0.0)


def stop_waiting(executor: Executor) -> None:
    """End the wait of `spin_some`, if there is one; for handlers of signals, which run in the thread that spins."""
    # `wake` is not enough: after it, `spin_once` looks for work and then goes on waiting. A task is work.
    executor.create_task(_do_nothing)


def _do_nothing() -> None:
    """Do nothing; as a task, this marks a position among the inputs, or ends a wait."""
