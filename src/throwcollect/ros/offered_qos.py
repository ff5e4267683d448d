"""The quality of service by which a topic is heard, whatever its publishers offer."""

from __future__ import annotations

from throwcollect import ros

_DEPTH = 100


def find_offered_qos(node: ros.Node, topic: str, unknown: ros.ReliabilityPolicy) -> ros.QoSProfile:
    """What all publishers of a topic offer.

    Args:
        node: A node that sees them.
        topic: Absolute name of the topic.
        unknown: Reliability while there are none: best effort hears all that may come, reliable is what most offer.
    """
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    profile = ros.QoSProfile(depth=_DEPTH, reliability=unknown)
    if offered:
        is_reliable = all(qos.reliability == ros.ReliabilityPolicy.RELIABLE for qos in offered)
        profile.reliability = ros.ReliabilityPolicy.RELIABLE if is_reliable else ros.ReliabilityPolicy.BEST_EFFORT
    if offered and all(qos.durability == ros.DurabilityPolicy.TRANSIENT_LOCAL for qos in offered):
        profile.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
    return profile
