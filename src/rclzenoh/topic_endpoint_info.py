"""Description of one publisher or subscription in the ROS graph."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from rclzenoh.keys import EntityKind, Token
from rclzenoh.qos import HistoryPolicy, QoSProfile, decode


class TopicEndpointTypeEnum(IntEnum):
    """Kind of an endpoint."""

    PUBLISHER = 1
    SUBSCRIPTION = 2


@dataclass(frozen=True)
class TopicEndpointInfo:
    """One publisher or subscription; the type is its ROS name, and the identifier has 16 octets."""

    node_name: str
    node_namespace: str
    topic_type: str
    topic_type_hash: str
    endpoint_type: TopicEndpointTypeEnum
    endpoint_gid: list[int]
    qos_profile: QoSProfile

    def __str__(self) -> str:
        qos = self.qos_profile
        depth = f" ({qos.depth})" if qos.history is HistoryPolicy.KEEP_LAST else ""
        return "\n".join(
            [
                f"Node name: {self.node_name}",
                f"Node namespace: {self.node_namespace}",
                f"Topic type: {self.topic_type}",
                f"Topic type hash: {self.topic_type_hash}",
                f"Endpoint type: {self.endpoint_type.name}",
                f"GID: {'.'.join(format(octet, '02x') for octet in self.endpoint_gid)}",
                "QoS profile:",
                f"  Reliability: {qos.reliability.name}",
                f"  History (Depth): {(qos.history or HistoryPolicy.UNKNOWN).name}{depth}",
                f"  Durability: {qos.durability.name}",
                f"  Lifespan: {qos.lifespan}",
                f"  Deadline: {qos.deadline}",
                f"  Liveliness: {qos.liveliness.name}",
                f"  Liveliness lease duration: {qos.liveliness_lease_duration}",
            ]
        )


def endpoint_info(token: Token) -> TopicEndpointInfo | None:
    """Describe the endpoint of a token; None if its QoS is malformed, because genuine nodes ignore such tokens."""
    qos = decode(token.qos)
    if qos is None:
        return None
    is_publisher = token.kind is EntityKind.PUBLISHER
    return TopicEndpointInfo(
        node_name=token.node,
        node_namespace=token.namespace,
        topic_type=token.ros_type,
        topic_type_hash=token.type_hash,
        endpoint_type=TopicEndpointTypeEnum.PUBLISHER if is_publisher else TopicEndpointTypeEnum.SUBSCRIPTION,
        endpoint_gid=list(token.gid),
        qos_profile=qos,
    )
