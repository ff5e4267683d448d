"""Finds actions in the ROS graph, by their feedback topics."""

from __future__ import annotations

from rclzenoh.graph import group_types
from rclzenoh.node_graph import NamesAndTypes, NodeGraph

_TOPIC, _TYPE = "/_action/feedback", "_FeedbackMessage"


def get_action_names_and_types(node: NodeGraph) -> NamesAndTypes:
    """All actions that somebody offers or uses."""
    return _list_actions(node.get_topic_names_and_types())


def get_action_server_names_and_types_by_node(
    node: NodeGraph, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Actions that one node offers."""
    return _list_actions(node.get_publisher_names_and_types_by_node(remote_node_name, remote_node_namespace))


def get_action_client_names_and_types_by_node(
    node: NodeGraph, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Actions that one node has clients of."""
    return _list_actions(node.get_subscriber_names_and_types_by_node(remote_node_name, remote_node_namespace))


def _list_actions(topics: NamesAndTypes) -> NamesAndTypes:
    return group_types(
        (name.removesuffix(_TOPIC), type_name.removesuffix(_TYPE))
        for name, types in topics
        for type_name in types
        if name.endswith(_TOPIC) and type_name.endswith(_TYPE)
    )
