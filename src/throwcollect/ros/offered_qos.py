"""The quality of service by which a subscription hears all publishers of a topic."""

from __future__ import annotations

from throwcollect import ros

_DEPTH = 100


def find_offered_qos(node: ros.Node, topic: str, unknown: ros.ReliabilityPolicy) -> ros.QoSProfile:
    """The strictest profile that all publishers of a topic, given by its absolute name, offer.

    While there is no publisher, reliability is ``unknown``: best effort hears every publisher, reliable suits most.
    """
    # ROS 2 connects a subscription only to publishers that offer what it asks for, so the weakest publisher decides.
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    profile = ros.QoSProfile(depth=_DEPTH, reliability=unknown)
    if offered:
        is_reliable = all(qos.reliability == ros.ReliabilityPolicy.RELIABLE for qos in offered)
        profile.reliability = ros.ReliabilityPolicy.RELIABLE if is_reliable else ros.ReliabilityPolicy.BEST_EFFORT
    if offered and all(qos.durability == ros.DurabilityPolicy.TRANSIENT_LOCAL for qos in offered):
        profile.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
    return profile
