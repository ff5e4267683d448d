"""Topics of the coordinator for onlookers, who may subscribe late."""

from __future__ import annotations

from throwcollect import ros
from throwcollect.ros import DurabilityPolicy, ReliabilityPolicy

PROGRESS_TOPIC = "/coordinator/progress"
"""The progress: a std_msgs/String of JSON."""
PROGRESS_QOS = ros.QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

SHOWN_QOS = ros.QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""A slow subscriber misses some episodes, and delays nobody."""


def make_shown_topic(simulation: str) -> str:
    """Name the topic of a simulation's newest episode, by its node's name; messages are as the simulation sent them."""
    return f"/coordinator/shown/{simulation}"
