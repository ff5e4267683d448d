"""What a node tells others about the types that it uses."""

import pytest
from tests.unit.interfaces.test_type_description import hashed

from throwcollect.interfaces import get_action, get_message, get_service, type_hash
from throwcollect.ros import ActionServer, Parameter

GetTypeDescription = get_service("type_description_interfaces/srv/GetTypeDescription")
String = get_message("std_msgs/msg/String")
FJT = get_action("control_msgs/action/FollowJointTrajectory")
NOT_IN_USE = "Type not currently in use by this node"


class Asking:
    def __init__(self, rig):
        self.rig = rig
        self.client = rig.node("asking").create_client(GetTypeDescription, "/node/get_type_description")

    def __call__(self, hashed, **fields):
        assert self.client.wait_for_service(5)
        return self.rig.result(self.client.call_async(GetTypeDescription.Request(type_hash=hashed, **fields)))


@pytest.fixture
def node(rig):
    return rig.node("node")


@pytest.fixture
def ask(rig, node):
    return Asking(rig)


@pytest.mark.parametrize(
    "name",
    [
        "rcl_interfaces/msg/Log",
        "rcl_interfaces/srv/SetParameters",
        GetTypeDescription.TYPE,
        FJT.TYPE,
        f"{FJT.TYPE}_SendGoal",
        f"{FJT.TYPE}_FeedbackMessage",
        "action_msgs/srv/CancelGoal",
    ],
)
def test_a_type_in_use_is_described(ask, node, name):
    ActionServer(node, FJT, "follow")
    response = ask(type_hash(name))
    assert response.successful
    assert response.type_description.type_description.type_name == name
    assert hashed(response.type_description) == type_hash(name)
    assert response.type_sources[0].type_name == name


def test_sources_are_left_out_on_request(ask, node):
    assert ask(type_hash("rcl_interfaces/msg/Log"), include_type_sources=False).type_sources == []


def test_a_type_is_described_while_it_is_in_use(ask, node):
    assert ask(type_hash(String.TYPE)).failure_reason == NOT_IN_USE
    subscription = node.create_subscription(String, "t", print, 1)
    assert ask(type_hash(String.TYPE)).successful
    node.destroy_subscription(subscription)
    assert not ask(type_hash(String.TYPE)).successful


@pytest.mark.parametrize("text", ["", "RIHS01_", "RIHS02_" + 64 * "0", "RIHS01_" + 63 * "0", "x" * 10_000])
def test_what_is_no_hash_is_refused(ask, node, text):
    response = ask(text)
    assert (response.successful, response.failure_reason) == (False, "Failed to parse type hash")


def test_the_service_can_be_switched_off(rig):
    node = rig.node("node", parameter_overrides=[Parameter("start_type_description_service", value=False)])
    names = [name for name, _ in node.get_service_names_and_types_by_node("node", "/")]
    assert "/node/set_parameters" in names
    assert "/node/get_type_description" not in names


def test_whether_there_is_the_service_can_be_read_but_not_set(node):
    (result,) = node.set_parameters([Parameter("start_type_description_service", value=False)])
    assert "read-only" in result.reason
