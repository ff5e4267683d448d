"""The methods by which a node asks about the ROS graph."""

from __future__ import annotations

from rclzenoh.keys import EntityKind
from rclzenoh.node_base import NodeBase
from rclzenoh.topic_endpoint_info import TopicEndpointInfo, endpoint_info

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
