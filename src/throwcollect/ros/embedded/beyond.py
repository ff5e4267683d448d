"""What nodes need beyond rclpy's public API; every backend offers it by the same names."""

from __future__ import annotations

from throwcollect.ros.embedded.node import Node
from throwcollect.session_config import is_protected


def graph_changes(node: Node) -> int:
    """A number that differs from what it was before whenever the ROS graph has changed in between."""
    return node.context.graph.changes


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that lets nobody in without a key.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    return is_protected()


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows what ``set_ros_time_override`` was last given."""
    node.get_clock().activate(True)
