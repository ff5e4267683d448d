"""What nodes need beyond rclpy's public API; every backend offers it by the same names."""

from __future__ import annotations

from throwcollect.ros.embedded.node import Node


def graph_changes(node: Node) -> int:
    """A number that differs from what it was before whenever the ROS graph has changed in between."""
    return node.context.graph.changes


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows what ``set_ros_time_override`` was last given."""
    node.get_clock().activate(True)
