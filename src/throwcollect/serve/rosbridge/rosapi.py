"""The services of rosapi, by which clients look around in the ROS graph, and that of ROS# that gives meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rclzenoh.interfaces import message_definition
from rclzenoh.names import join
from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.robots.urdf import PACKAGE
from throwcollect.ros.graph_names import absolute_name, full_name, is_hidden
from throwcollect.ros.message_values import plain
from throwcollect.serve.robot_files import find_mesh
from throwcollect.serve.rosbridge.bridge import Client
from throwcollect.serve.rosbridge.guarded import is_guarded
from throwcollect.serve.rosbridge.operations import Arguments
from throwcollect.serve.rosbridge.parameters import get_parameter, has_parameter, list_parameters, set_parameter

Service = Callable[[Arguments], Any]
"""Makes the fields of the response from the arguments, now or when it is awaited."""
Values = Mapping[str, object]
Found = Iterable[tuple[str, list[str]]]

SET_PARAMETER = "rosapi/set_param"
"""The only service here that changes something."""


def make_services(client: Client) -> Mapping[str, Service]:
    """Services that the bridge answers for a client, by their names without a slash at the beginning."""
    node = client.bridge.node
    # What is reported of the graph leaves out hidden names, and topics that clients may not have.
    graph: dict[str, Service] = {
        "topics": lambda _: _list_topics(_find_topics(node)),
        "topics_and_raw_types": lambda _: {
            **_list_topics(topics := _find_topics(node)),
            "typedefs_full_text": [_find_definition(type_name) for type_name in topics.values()],
        },
        "topics_for_type": lambda asked: {"topics": _names_of(_find_topics(node), full_name("msg", asked.type))},
        "topic_type": lambda asked: {"type": _find_topics(node).get(absolute_name(asked.topic), "")},
        "services": lambda _: {"services": list(_find_services(node))},
        "services_for_type": lambda asked: {"services": _names_of(_find_services(node), full_name("srv", asked.type))},
        "service_type": lambda asked: {"type": _find_services(node).get(absolute_name(asked.service), "")},
        "action_servers": lambda _: {"action_servers": _find_actions(node)},
        "nodes": lambda _: {"nodes": [join(namespace, name) for name, namespace in _find_nodes(node)]},
        "node_details": lambda asked: _describe_node(node, asked.node),
        "get_time": lambda _: {"time": plain(node.get_clock().now().to_msg())},
        "get_ros_version": lambda _: {"version": 2, "distro": "jazzy"},
        "get_param": partial(get_parameter, client),
        "has_param": partial(has_parameter, client),
        "get_param_names": partial(list_parameters, client),
        "set_param": partial(set_parameter, client),
    }
    return {**{f"rosapi/{name}": service for name, service in graph.items()}, "file_server/get_file": _give_file}


def _find_topics(node: ros.Node) -> dict[str, str]:
    """Topics that clients may have, with their types."""
    topics = _list_visible(node.get_topic_names_and_types())
    return {name: types[0] for name, types in topics if not is_guarded(name)}


def _list_topics(topics: Mapping[str, str]) -> Values:
    return {"topics": list(topics), "types": list(topics.values())}


def _find_services(node: ros.Node) -> dict[str, str]:
    return {name: types[0] for name, types in _list_visible(node.get_service_names_and_types())}


def _find_nodes(node: ros.Node) -> list[tuple[str, str]]:
    """Names and namespaces."""
    found = sorted(set(node.get_node_names_and_namespaces()))
    return [(name, namespace) for name, namespace in found if not is_hidden(join(namespace, name))]


def _find_actions(node: ros.Node) -> list[str]:
    # On DDS, the graph also names services that nodes want to call and that no node offers.
    offered = {
        service
        for owner in node.get_node_names_and_namespaces()
        for service, _ in node.get_service_names_and_types_by_node(*owner)
    }
    actions = _list_visible(ros.get_action_names_and_types(node))
    return [name for name, _ in actions if f"{name}/_action/send_goal" in offered]


def _describe_node(node: ros.Node, asked: str) -> Values:
    namespace, _, name = absolute_name(asked).rpartition("/")
    owner = name, namespace or "/"
    if owner not in _find_nodes(node):
        # As in the original rosapi, a client that asks for all nodes in turn must not fail if one has just ended.
        return {"subscribing": [], "publishing": [], "services": []}
    return {
        "subscribing": [each for each, _ in _list_visible(node.get_subscriber_names_and_types_by_node(*owner))],
        "publishing": [each for each, _ in _list_visible(node.get_publisher_names_and_types_by_node(*owner))],
        "services": [each for each, _ in _list_visible(node.get_service_names_and_types_by_node(*owner))],
    }


def _list_visible(found: Found) -> list[tuple[str, list[str]]]:
    return sorted((name, types) for name, types in found if not is_hidden(name))


def _names_of(types: Mapping[str, str], wanted: str) -> list[str]:
    return [name for name, type_name in types.items() if type_name == wanted]


def _find_definition(type_name: str) -> str:
    """Definition of a message as rosbag2 stores it; empty for a message that only an installed ROS has."""
    try:
        return message_definition(type_name)
    except ValueError:
        return ""


def _give_file(asked: Arguments) -> Values:
    """The bytes of a mesh, named as ``package://NAME/PATH``."""
    if not asked.name.startswith(PACKAGE):
        raise ConfigError(f"{asked.name}: not a file of a robot's description", expected=f"{PACKAGE}NAME/PATH")
    package, _, path = asked.name.removeprefix(PACKAGE).partition("/")
    return {"value": find_mesh(package, path).read_bytes()}
