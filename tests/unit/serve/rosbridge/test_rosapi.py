"""The services of rosapi, by which clients look at the ROS graph."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for

from rclzenoh.interfaces import message_definition
from throwcollect.robots.talos import TALOS
from throwcollect.ros import ActionServer, Node, Parameter, SetParametersResult, get_action, get_message, get_service
from throwcollect.ros.connection import Connection
from throwcollect.serve.rosbridge import Bridge

FJT: Any = get_action("control_msgs/action/FollowJointTrajectory")
JointState: Any = get_message("sensor_msgs/msg/JointState")
String: Any = get_message("std_msgs/msg/String")
SetBool: Any = get_service("std_srvs/srv/SetBool")


@pytest.fixture
def graph(node: Node, party: Party) -> Node:
    """A node that has one of everything, and topics that rosapi must hide."""
    node.create_publisher(JointState, "/states", 10)
    for hidden in ("/_hidden", "/sim_0/episode", "/part/_of/it"):
        node.create_publisher(String, hidden, 10)
    node.create_subscription(String, "/orders", lambda _: None, 10)
    node.create_service(SetBool, "/lamp", lambda _, response: response)
    ActionServer(node, FJT, "/follow", lambda _: FJT.Result())
    node.declare_parameter("mass", 0.5)
    node.declare_parameter("names", ["a"])
    node.declare_parameter("trial.leases", [""])
    wait_for(lambda: party.call("rosapi/action_servers") == {"action_servers": ["/follow"]})
    return node


def test_rosapi_lists_topics_with_types_and_without_hidden_ones(party: Party, graph: Node) -> None:
    told = party.call("/rosapi/topics")
    topics = dict(zip(told["topics"], told["types"], strict=True))
    assert topics == {
        "/orders": "std_msgs/msg/String",
        "/rosout": "rcl_interfaces/msg/Log",
        "/states": "sensor_msgs/msg/JointState",
    }
    raw = party.call("/rosapi/topics_and_raw_types")
    assert raw["topics"] == told["topics"]
    assert raw["typedefs_full_text"] == [message_definition(name) for name in told["types"]]
    assert party.call("/rosapi/topic_type", topic="states") == {"type": "sensor_msgs/msg/JointState"}
    assert party.call("/rosapi/topic_type", topic="/none") == {"type": ""}
    assert party.call("/rosapi/topics_for_type", type="sensor_msgs/JointState") == {"topics": ["/states"]}
    assert party.call("/rosapi/publishers", topic="/states") == {"publishers": ["/other"]}
    assert party.call("/rosapi/publishers", topic="/orders") == {"publishers": []}
    assert party.call("/rosapi/subscribers", topic="/orders") == {"subscribers": ["/other"]}


def test_rosapi_lists_services_with_types_and_nodes(party: Party, graph: Node) -> None:
    services = party.call("/rosapi/services")["services"]
    assert "/lamp" in services
    assert not [each for each in services if "/_action/" in each]
    assert party.call("/rosapi/services_for_type", type="std_srvs/SetBool") == {"services": ["/lamp"]}
    assert party.call("/rosapi/service_type", service="/lamp") == {"type": "std_srvs/srv/SetBool"}
    assert party.call("/rosapi/service_type", service="/none") == {"type": ""}
    assert party.call("/rosapi/service_providers", service="lamp") == {"providers": ["/other"]}
    assert party.call("/rosapi/service_providers", service="std_srvs/srv/SetBool") == {"providers": ["/other"]}
    assert party.call("/rosapi/service_providers", service="std_srvs/Trigger") == {"providers": []}
    assert party.call("/rosapi/service_node", service="/lamp") == {"node": "/other"}
    assert party.call("/rosapi/service_node", service="/none") == {"node": ""}


def test_rosapi_lists_nodes_with_their_topics_and_services(party: Party, graph: Node) -> None:
    assert party.call("/rosapi/nodes") == {"nodes": ["/other"]}
    details = party.call("/rosapi/node_details", node="/other")
    assert details["subscribing"] == ["/orders"]
    assert {"/states", "/rosout"} <= set(details["publishing"])
    assert "/_hidden" not in details["publishing"]
    assert "/lamp" in details["services"]
    empty: dict[str, list[str]] = {"subscribing": [], "publishing": [], "services": []}
    assert party.call("/rosapi/node_details", node="/gone") == empty


def test_rosapi_describes_a_type_with_all_nested_types(party: Party) -> None:
    first, *others = party.call("/rosapi/message_details", type="sensor_msgs/JointState")["typedefs"]
    assert first == {
        "type": "sensor_msgs/JointState",
        "fieldnames": ["header", "name", "position", "velocity", "effort"],
        "fieldtypes": ["std_msgs/Header", "string", "double", "double", "double"],
        "fieldarraylen": [-1, 0, 0, 0, 0],
        "examples": ["{}", "[]", "[]", "[]", "[]"],
        "constnames": [],
        "constvalues": [],
    }
    assert [each["type"] for each in others] == ["std_msgs/Header", "builtin_interfaces/Time"]
    (request,) = party.call("/rosapi/service_request_details", type="std_srvs/SetBool")["typedefs"]
    assert (request["type"], request["fieldnames"], request["examples"]) == (
        "std_srvs/SetBool_Request",
        ["data"],
        ["False"],
    )
    (response,) = party.call("/rosapi/service_response_details", type="std_srvs/srv/SetBool")["typedefs"]
    assert response["fieldtypes"] == ["boolean", "string"]
    (field,) = party.call("/rosapi/message_details", type="sensor_msgs/PointField")["typedefs"]
    assert dict(zip(field["constnames"], field["constvalues"], strict=True))["FLOAT64"] == "8"
    pose = party.call("/rosapi/message_details", type="geometry_msgs/PoseWithCovariance")["typedefs"]
    assert pose[0]["fieldarraylen"] == [-1, 36]
    assert "no_msgs/No" in party.call("/rosapi/message_details", type="no_msgs/No")


def test_parameters_are_listed_read_and_set(party: Party, graph: Node) -> None:
    names = party.call("/rosapi/get_param_names")["names"]
    assert {"/other:mass", "/other:names"} <= set(names)
    assert party.call("/rosapi/get_param", name="/other:mass") == {"value": "0.5"}
    assert party.call("/rosapi/get_param", name="other:names") == {"value": '["a"]'}
    assert party.call("/rosapi/has_param", name="/other:mass") == {"exists": True}
    assert party.call("/rosapi/has_param", name="/other:none") == {"exists": False}
    assert party.call("/rosapi/get_param", name="/other:none", default_value="7") == {"value": "7"}
    assert party.call("/rosapi/get_param", name="/gone:none", default_value="[1]") == {"value": "[1]"}
    assert party.call("/rosapi/get_param", name="/gone:none", default_value="no JSON") == {"value": '"no JSON"'}
    # JavaScript has only one kind of number, so a whole one must be accepted for a double.
    assert party.call("/rosapi/set_param", name="/other:mass", value="1")["successful"]
    assert graph.get_parameter("mass").value == 1.0
    assert party.call("/rosapi/set_param", name="/other:names", value='["b", "c"]')["successful"]
    assert graph.get_parameter("names").value == ["b", "c"]


@pytest.mark.parametrize(
    ("service", "arguments", "said"),
    [
        ("get_param", {"name": "/gone:mass"}, "/gone:mass: there is no such node, or it has no such parameter"),
        ("get_param", {"name": "/other:trial.leases"}, "only the coordinator may have this parameter"),
        ("set_param", {"name": "/other:trial.leases", "value": "[]"}, "only the coordinator may have this"),
        ("set_param", {"name": "/other:mass", "value": "-1"}, "/other:mass: too light"),
    ],
)
def test_a_wrong_call_of_rosapi_fails_with_the_reason(
    party: Party, graph: Node, service: str, arguments: Any, said: str
) -> None:
    def judge(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=parameters[0].value > 0, reason="too light")

    graph.add_on_set_parameters_callback(judge)
    party.ask(op="call_service", id="r", service=f"/rosapi/{service}", args=arguments)
    answer = party.next(op="service_response", id="r")
    assert answer["result"] is False
    assert said in answer["values"]


@pytest.fixture(scope="module")
def mesh_bridge(connection: Connection) -> Iterator[Bridge]:
    bridge = Bridge(connection)
    yield bridge
    bridge.close()


@pytest.fixture
def reader(mesh_bridge: Bridge) -> Iterator[Party]:
    party = Party(mesh_bridge, read_only=True)
    yield party
    party.client.close()


MESH = "example-robot-data/robots/talos_data/meshes/head/head_1.stl"


def test_a_read_only_client_can_read_meshes_of_the_robot(reader: Party) -> None:
    path = TALOS.share() / MESH
    found = reader.call("/file_server/get_file", name=f"package://{MESH}")
    assert base64.b64decode(found["value"]) == path.read_bytes()


@pytest.mark.parametrize("name", ["package://example-robot-data/none.stl", "/etc/passwd", "file:///etc/passwd"])
def test_files_that_are_no_meshes_of_robots_are_refused(reader: Party, name: str) -> None:
    reader.ask(op="call_service", id="f", service="/file_server/get_file", args={"name": name})
    answer = reader.next(id="f")
    assert answer["result"] is False
    assert "package" in answer["values"]


@pytest.mark.parametrize(
    "asked",
    [
        {"op": "publish", "topic": "/t", "msg": {}},
        {"op": "advertise", "topic": "/t", "type": "std_msgs/String"},
        {"op": "advertise_service", "service": "/t", "type": "std_srvs/SetBool"},
        {"op": "advertise_action", "action": "/t", "type": "control_msgs/FollowJointTrajectory"},
        {"op": "call_service", "service": "/sim_0/reset_simulation"},
        {"op": "call_service", "service": "/rosapi/set_param", "args": {"name": "/other:mass", "value": "1"}},
        {"op": "send_action_goal", "action": "/t", "action_type": "control_msgs/FollowJointTrajectory"},
        {"op": "cancel_action_goal", "action": "/t"},
    ],
)
def test_a_read_only_client_cannot_change_anything(reader: Party, asked: Any) -> None:
    reader.client.receive(json.dumps({"id": "x", **asked}))
    told = reader.next(id="x")
    assert "this client may only look" in (told.get("msg") or told["values"])
    assert told.get("result", False) is False
    assert told["op"] in ("status", "service_response", "action_result")
