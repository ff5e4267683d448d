"""What nodes need beyond rclpy's public API; every backend offers it by the same names."""

from __future__ import annotations

import logging

from rclzenoh.executors import Executor
from rclzenoh.logging import LoggingSeverity
from rclzenoh.node import Node


def graph_changes(node: Node) -> int:
    """A number that differs from what it was before whenever the ROS graph has changed in between."""
    return node.context.graph.changes


def let_callbacks_wait(_node: Node) -> None:
    """Have a node go on with other callbacks while one, a coroutine, waits: here all nodes do."""


def pass_on_log(node: Node, record: logging.LogRecord) -> None:
    """Log what was logged by Python's own logging, under a node's name and with the place that it came from."""
    place = (record.pathname, record.funcName or "", record.lineno)
    node.get_logger().log_from(place, record.getMessage(), LoggingSeverity(record.levelno))


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows what ``set_ros_time_override`` was last given."""
    node.get_clock().activate(True)


def spin_some(executor: Executor, timeout_sec: float) -> None:
    """Wait for an input, then call back with it and all others that have come by then, but none that come meanwhile.

    Args:
        executor: The executor.
        timeout_sec: Longest time to wait [s].
    """
    executor.spin_once(timeout_sec)
    last = executor.create_task(_nothing)
    while not last.done():
        executor.spin_once(timeout_sec=0.0)


def stop_waiting(executor: Executor) -> None:
    """Have `spin_some` come back at once if it waits just now; for handlers of signals, in the thread that spins."""
    executor.create_task(_nothing)


def _nothing() -> None:
    """Work that marks a place among the inputs."""
