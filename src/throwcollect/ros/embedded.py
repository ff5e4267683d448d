"""The embedded backend: `rclzenoh`, which needs no installation of ROS 2, and functions that rclpy lacks."""

# ruff: noqa: F401 - `throwcollect.ros` looks up what is imported here.

from __future__ import annotations

import logging

import rclzenoh.context
from rclzenoh.action.client import ActionClient, get_action_names_and_types
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
from rclzenoh.session_config import client_config, is_protected
from rclzenoh.task import Future
from rclzenoh.time import Time
from rclzenoh.topic import Publisher
from throwcollect.ros.connection import Connection, zenoh_errors
from throwcollect.ros.middleware import EMBEDDED_RMW


def init(*, context: Context | None = None, connection: Connection | None = None) -> None:
    """Initialise a context.

    Args:
        context: The context; None for the default one.
        connection: The way into the graph; None for the one that the environment describes.
    """
    domain_id = config = None
    with zenoh_errors():
        if connection is not None:
            connection.check(EMBEDDED_RMW)
            domain_id = connection.domain_id
            config = client_config(connection.endpoint, connection.key)
        rclzenoh.context.init(context=context, domain_id=domain_id, config=config)


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that rejects processes without a key."""
    with zenoh_errors():
        return is_protected()


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
    """Make a node the source of its own time: its clock shows the last ``set_ros_time_override``.

    The node refuses `use_sim_time`, with which it would show the time of the publisher of ``/clock``, and
    the time of the system afterwards.
    """
    node.get_clock().activate(True)
    node.add_on_set_parameters_callback(_refuse_other_time)


def _refuse_other_time(parameters: list[Parameter]) -> SetParametersResult:
    if any(parameter.name == "use_sim_time" and parameter.value for parameter in parameters):
        return SetParametersResult(successful=False, reason="use_sim_time: this node makes its time itself")
    return SetParametersResult(successful=True)


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
