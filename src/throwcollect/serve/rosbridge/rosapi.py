"""The services of rosapi, by which clients look around in the ROS graph, and that of ROS# that gives meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rclzenoh.interfaces import message_definition
from rclzenoh.interfaces.catalog import structure
from rclzenoh.names import join
from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.robots.urdf import PACKAGE
from throwcollect.ros.graph_names import Kind, absolute_name, find_interface, full_name, is_hidden
from throwcollect.ros.message_values import array_parts, plain
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
        "publishers": lambda asked: {
            "publishers": _owners_of(node.get_publishers_info_by_topic(absolute_name(asked.topic)))
        },
        "subscribers": lambda asked: {
            "subscribers": _owners_of(node.get_subscriptions_info_by_topic(absolute_name(asked.topic)))
        },
        "services": lambda _: {"services": list(_find_services(node))},
        "services_for_type": lambda asked: {"services": _names_of(_find_services(node), full_name("srv", asked.type))},
        "service_type": lambda asked: {"type": _find_services(node).get(absolute_name(asked.service), "")},
        # The rosapi of ROS 2 takes a type here, although the field is called service; earlier ones take a name.
        "service_providers": lambda asked: {
            "providers": _find_providers(node, absolute_name(asked.service), full_name("srv", asked.service))
        },
        "service_node": lambda asked: {"node": next(iter(_find_providers(node, absolute_name(asked.service))), "")},
        "action_servers": lambda _: {"action_servers": _find_actions(node)},
        "nodes": lambda _: {"nodes": [join(namespace, name) for name, namespace in _find_nodes(node)]},
        "node_details": lambda asked: _describe_node(node, asked.node),
        "message_details": lambda asked: _describe_type("msg", asked.type),
        "service_request_details": lambda asked: _describe_type("srv", asked.type, "Request"),
        "service_response_details": lambda asked: _describe_type("srv", asked.type, "Response"),
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


def _find_providers(node: ros.Node, name: str, type_name: str | None = None) -> list[str]:
    """Nodes that offer a service of this name, or one of this type."""
    return [
        join(namespace, owner)
        for owner, namespace in _find_nodes(node)
        if any(
            service == name or type_name in types
            for service, types in node.get_service_names_and_types_by_node(owner, namespace)
        )
    ]


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


def _owners_of(endpoints: Iterable[Any]) -> list[str]:
    names = {join(each.node_namespace, each.node_name) for each in endpoints}
    return sorted(name for name in names if not is_hidden(name))


def _describe_type(kind: Kind, name: str, part: str = "") -> Values:
    """Describe a message, or a part of a service, named in full or as ``pkg/Type``, and the messages in it."""
    found, full = find_interface(kind, name), full_name(kind, name)
    typedefs: dict[str, Values] = {}
    _describe(f"{full}_{part}" if part else full, getattr(found, part) if part else found, typedefs)
    return {"typedefs": list(typedefs.values())}


def _describe(name: str, message_class: Any, typedefs: dict[str, Values]) -> None:
    """Add a message, and the messages in it that are not there yet, as rosapi_msgs/msg/TypeDef."""
    types: Mapping[str, str] = message_class.get_fields_and_field_types()
    arrays = [array_parts(kind) for kind in types.values()]
    kinds = [parts[0] if parts else kind for parts, kind in zip(arrays, types.values(), strict=True)]
    message = message_class()
    try:
        constants = structure(name).constants
    except ValueError:
        # Only an installed ROS has this message.
        constants = {}
    package, _, short = name.split("/")
    typedefs[name] = {
        "type": f"{package}/{short}",
        "fieldnames": list(types),
        "fieldtypes": kinds,
        # In rosapi, -1 stands for no array, and 0 for an array of any length.
        "fieldarraylen": [parts[2] or 0 if parts else -1 for parts in arrays],
        "examples": [
            "[]" if array_parts(kind) else "{}" if "/" in kind else str(getattr(message, field))
            for field, kind in types.items()
        ],
        "constnames": list(constants),
        "constvalues": [str(value) for value in constants.values()],
    }
    for kind in kinds:
        if "/" in kind and (inner := full_name("msg", kind)) not in typedefs:
            _describe(inner, ros.get_message(inner), typedefs)


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
