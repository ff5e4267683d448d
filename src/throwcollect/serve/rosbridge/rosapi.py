"""The services of rosapi, by which clients look around in the ROS graph, and that of ROS# that gives meshes."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

from rclzenoh.interfaces import message_definition
from rclzenoh.interfaces.catalog import structure
from rclzenoh.names import join
from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.robots.urdf import PACKAGE
from throwcollect.ros.graph_names import absolute_name, find_interface, full_name, is_hidden
from throwcollect.ros.message_values import array_parts
from throwcollect.serve.robot_files import find_mesh
from throwcollect.serve.rosbridge.errands import Questions
from throwcollect.serve.rosbridge.guarded import is_guarded
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.rosapi_parameters import Parameters
from throwcollect.serve.rosbridge.service_calls import Call
from throwcollect.units import NS_PER_S

Answer = Callable[[Call], None]
Values = Mapping[str, object]
NamesAndTypes = Iterable[tuple[str, list[str]]]

SET_PARAMETER = "rosapi/set_param"
"""The only service of rosapi that changes something."""


class Rosapi:
    """The services of rosapi for one client. They leave out hidden names, and topics that clients may not have.

    Attributes:
        answers: Function that answers each service, by its name without a slash at its beginning.
    """

    def __init__(self, client: Peer, questions: Questions) -> None:
        self._client = client
        at_once: Mapping[str, Callable[[Call], Values]] = {
            "topics": self._list_topics,
            "topics_and_raw_types": self._list_topics_and_definitions,
            "topics_for_type": self._list_topics_of_type,
            "topic_type": self._find_topic_type,
            "publishers": self._list_publishers,
            "subscribers": self._list_subscribers,
            "services": self._list_services,
            "services_for_type": self._list_services_of_type,
            "service_type": self._find_service_type,
            "service_providers": self._list_providers,
            "service_node": self._find_provider,
            "action_servers": self._list_actions,
            "nodes": self._list_nodes,
            "node_details": self._describe_node,
            "message_details": lambda call: {"typedefs": describe_message(call.fields.text("type"))},
            "service_request_details": lambda call: _describe_service(call, "Request"),
            "service_response_details": lambda call: _describe_service(call, "Response"),
            "get_time": self._get_time,
            "get_ros_version": lambda _: {"version": 2, "distro": "jazzy"},
        }
        parameters = Parameters(client, questions)
        later: Mapping[str, Answer] = {
            "get_param": parameters.get,
            "set_param": parameters.set,
            "has_param": parameters.has,
            "get_param_names": parameters.list_all,
            "delete_param": parameters.delete,
        }
        self.answers: Mapping[str, Answer] = {
            **{f"rosapi/{name}": _reply_with(answer) for name, answer in at_once.items()},
            **{f"rosapi/{name}": answer for name, answer in later.items()},
        }

    @property
    def _node(self) -> ros.Node:
        return self._client.host.session.node

    def _find_topics(self) -> dict[str, str]:
        """Topics that clients may have, with their types."""
        topics = _list_visible(self._node.get_topic_names_and_types())
        return {name: types[0] for name, types in topics if not is_guarded(name)}

    def _find_services(self) -> dict[str, str]:
        return {name: types[0] for name, types in _list_visible(self._node.get_service_names_and_types())}

    def _find_nodes(self) -> list[tuple[str, str]]:
        """Names and namespaces."""
        found = sorted(set(self._node.get_node_names_and_namespaces()))
        return [(name, namespace) for name, namespace in found if not is_hidden(join(namespace, name))]

    def _list_topics(self, _call: Call) -> Values:
        topics = self._find_topics()
        return {"topics": list(topics), "types": list(topics.values())}

    def _list_topics_and_definitions(self, call: Call) -> Values:
        texts = [_find_definition(type_name) for type_name in self._find_topics().values()]
        return {**self._list_topics(call), "typedefs_full_text": texts}

    def _list_topics_of_type(self, call: Call) -> Values:
        wanted = full_name("msg", call.fields.text("type"))
        return {"topics": [name for name, type_name in self._find_topics().items() if type_name == wanted]}

    def _find_topic_type(self, call: Call) -> Values:
        return {"type": self._find_topics().get(absolute_name(call.fields.text("topic")), "")}

    def _list_publishers(self, call: Call) -> Values:
        infos = self._node.get_publishers_info_by_topic(absolute_name(call.fields.text("topic")))
        return {"publishers": _list_names(infos)}

    def _list_subscribers(self, call: Call) -> Values:
        infos = self._node.get_subscriptions_info_by_topic(absolute_name(call.fields.text("topic")))
        return {"subscribers": _list_names(infos)}

    def _list_services(self, _call: Call) -> Values:
        return {"services": list(self._find_services())}

    def _list_services_of_type(self, call: Call) -> Values:
        wanted = full_name("srv", call.fields.text("type"))
        return {"services": [name for name, type_name in self._find_services().items() if type_name == wanted]}

    def _find_service_type(self, call: Call) -> Values:
        return {"type": self._find_services().get(absolute_name(call.fields.text("service")), "")}

    def _find_providers(self, name: str, type_name: str | None = None) -> list[str]:
        """Nodes that offer a service of this name, or one of this type."""
        return [
            join(namespace, node)
            for node, namespace in self._find_nodes()
            if any(
                service == name or type_name in types
                for service, types in self._node.get_service_names_and_types_by_node(node, namespace)
            )
        ]

    def _list_providers(self, call: Call) -> Values:
        # The rosapi of ROS 2 takes a type here, although the field is called service; earlier ones take a name.
        wanted = call.fields.text("service")
        return {"providers": self._find_providers(absolute_name(wanted), full_name("srv", wanted))}

    def _find_provider(self, call: Call) -> Values:
        return {"node": next(iter(self._find_providers(absolute_name(call.fields.text("service")))), "")}

    def _list_actions(self, _call: Call) -> Values:
        actions = [name for name, _ in _list_visible(ros.get_action_names_and_types(self._node))]
        # On DDS, the graph also names services that nodes want to call and that no node offers.
        offered = {
            service
            for node in self._node.get_node_names_and_namespaces()
            for service, _ in self._node.get_service_names_and_types_by_node(*node)
        }
        return {"action_servers": [name for name in actions if f"{name}/_action/send_goal" in offered]}

    def _list_nodes(self, _call: Call) -> Values:
        return {"nodes": [join(namespace, name) for name, namespace in self._find_nodes()]}

    def _describe_node(self, call: Call) -> Values:
        namespace, _, name = absolute_name(call.fields.text("node")).rpartition("/")
        owner = (name, namespace or "/")
        if owner not in self._find_nodes():
            # As in the original rosapi, a client that asks for all nodes in turn must not fail if one has just ended.
            return {"subscribing": [], "publishing": [], "services": []}
        return {
            "subscribing": [
                each for each, _ in _list_visible(self._node.get_subscriber_names_and_types_by_node(*owner))
            ],
            "publishing": [each for each, _ in _list_visible(self._node.get_publisher_names_and_types_by_node(*owner))],
            "services": [each for each, _ in _list_visible(self._node.get_service_names_and_types_by_node(*owner))],
        }

    def _get_time(self, _call: Call) -> Values:
        seconds, nanoseconds = divmod(self._node.get_clock().now().nanoseconds, NS_PER_S)
        return {"time": {"sec": seconds, "nanosec": nanoseconds}}


def _reply_with(answer: Callable[[Call], Values]) -> Answer:
    return lambda call: call.reply(answer(call))


def _describe_service(call: Call, part: Literal["Request", "Response"]) -> Values:
    return {"typedefs": describe_service(call.fields.text("type"), part)}


def _list_visible(found: NamesAndTypes) -> list[tuple[str, list[str]]]:
    return sorted((name, types) for name, types in found if not is_hidden(name))


def _list_names(infos: Iterable[object]) -> list[str]:
    names = {join(info.node_namespace, info.node_name) for info in infos}  # type: ignore[attr-defined]
    return sorted(name for name in names if not is_hidden(name))


def _find_definition(type_name: str) -> str:
    """Definition of a message as rosbag2 stores it; empty for a message that only an installed ROS has."""
    try:
        return message_definition(type_name)
    except ValueError:
        return ""


GET_FILE = "file_server/get_file"
"""Name of the service, without a slash at its beginning."""


def give_file(call: Call) -> None:
    """Answer a call with the bytes of a mesh that it names as ``package://NAME/PATH``."""
    url = call.fields.text("name")
    name, _, rest = url.removeprefix(PACKAGE).partition("/")
    if not url.startswith(PACKAGE):
        raise ConfigError(f"{url}: not a file of a robot's description", expected=f"{PACKAGE}NAME/PATH")
    path = find_mesh(name, rest)
    data = path.read_bytes()
    call.reply({"value": base64.b64encode(data).decode() if call.form.compression == "none" else data})


Definition = Mapping[str, object]
"""Fields of rosapi_msgs/msg/TypeDef."""


def describe_message(name: str) -> list[Definition]:
    """Describe a message, named in full or as ``pkg/Type``."""
    return _describe(full_name("msg", name), find_interface("msg", name), [])


def describe_service(name: str, part: Literal["Request", "Response"]) -> list[Definition]:
    """Describe the request or the response of a service, named in full or as ``pkg/Type``."""
    service = find_interface("srv", name)
    return _describe(f"{full_name('srv', name)}_{part}", getattr(service, part), [])


def _describe(name: str, message_class: Any, seen: list[str]) -> list[Definition]:
    seen.append(name)
    message, kinds, lengths, examples = message_class(), [], [], []
    types = message_class.get_fields_and_field_types()
    for field, kind in types.items():
        parts = array_parts(kind)
        kinds.append(parts[0] if parts else kind)
        # In rosapi, -1 stands for no array, and 0 for an array of any length.
        lengths.append(-1 if parts is None else parts[2] or 0)
        examples.append("[]" if parts else "{}" if "/" in kind else str(getattr(message, field)))
    constants = _find_constants(name)
    package, _, short = name.replace("/", " ").split()
    definition = {
        "type": f"{package}/{short}",
        "fieldnames": list(types),
        "fieldtypes": kinds,
        "fieldarraylen": lengths,
        "examples": examples,
        "constnames": list(constants),
        "constvalues": [str(value) for value in constants.values()],
    }
    found: list[Definition] = [definition]
    for kind in kinds:
        inner = full_name("msg", kind)
        if "/" in kind and inner not in seen:
            found += _describe(inner, ros.get_message(inner), seen)
    return found


def _find_constants(name: str) -> Mapping[str, object]:
    try:
        return structure(name).constants
    except ValueError:
        return {}
