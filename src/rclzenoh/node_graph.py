"""The methods by which a node asks about the ROS graph, and the descriptions of endpoints that they return."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from rclzenoh.keys import EntityKind, Token
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile, decode


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


NamesAndTypes = list[tuple[str, list[str]]]
"""Names of topics or services, each with its types."""


class NodeGraph(NodeBase):
    """The graph as the node's context sees it; hidden names are included."""

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Names and namespaces of all nodes."""
        return sorted((token.node, token.namespace) for token in self.context.graph.tokens(EntityKind.NODE))

    def get_topic_names_and_types(self) -> NamesAndTypes:
        """All topics."""
        return self.context.graph.names_and_types(EntityKind.PUBLISHER, EntityKind.SUBSCRIPTION)

    def get_service_names_and_types(self) -> NamesAndTypes:
        """All services that are offered."""
        return self.context.graph.names_and_types(EntityKind.SERVICE)

    def get_publisher_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Topics that a node publishes."""
        return self.context.graph.names_and_types(EntityKind.PUBLISHER, node=(node_namespace, node_name))

    def get_subscriber_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Topics that a node subscribes to."""
        return self.context.graph.names_and_types(EntityKind.SUBSCRIPTION, node=(node_namespace, node_name))

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Services that a node offers."""
        return self.context.graph.names_and_types(EntityKind.SERVICE, node=(node_namespace, node_name))

    def get_client_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Services that a node has clients of."""
        return self.context.graph.names_and_types(EntityKind.CLIENT, node=(node_namespace, node_name))

    def count_publishers(self, topic_name: str) -> int:
        """Publishers of a topic, given by its absolute, relative or private name."""
        return self.context.graph.count(EntityKind.PUBLISHER, self.resolve_topic_name(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Subscriptions to a topic, given by its absolute, relative or private name."""
        return self.context.graph.count(EntityKind.SUBSCRIPTION, self.resolve_topic_name(topic_name))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """All publishers of a topic, given by its absolute, relative or private name."""
        return self._list_endpoints_info(EntityKind.PUBLISHER, topic_name)

    def get_subscriptions_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """All subscriptions to a topic, given by its absolute, relative or private name."""
        return self._list_endpoints_info(EntityKind.SUBSCRIPTION, topic_name)

    def _list_endpoints_info(self, kind: EntityKind, topic_name: str) -> list[TopicEndpointInfo]:
        name = self.resolve_topic_name(topic_name)
        infos = (endpoint_info(token) for token in self.context.graph.tokens(kind, name=name))
        return [info for info in infos if info is not None]
