"""The topics on which the coordinator tells what goes on, for whoever comes, however late."""

from __future__ import annotations

from throwcollect import ros
from throwcollect.ros import DurabilityPolicy, ReliabilityPolicy

PROGRESS_TOPIC = "/coordinator/progress"
"""The progress: a std_msgs/String of JSON."""
PROGRESS_QOS = ros.QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

SHOWN_QOS = ros.QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Whoever is slow misses some, and holds nobody up."""


def make_shown_topic(simulation: str) -> str:
    """Topic of the newest episode of a simulation, as it arrived: a std_msgs/UInt8MultiArray.

    Args:
        simulation: Name of its node.
    """
    return f"/coordinator/shown/{simulation}"
