"""Topics, services and actions of a simulation, as `ros2 node info` and late subscribers see them."""

import xml.etree.ElementTree as ET
from typing import Any

import pinocchio
import pytest

from rclzenoh.keys import EntityKind, Token
from tests.integration.robot import ARM, PAUSED, Robot
from throwcollect.robots.talos import TALOS
from throwcollect.ros import DurabilityPolicy, QoSProfile, get_action_names_and_types
from throwcollect.ros.middleware import uses_rclpy

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ACTION = "control_msgs/action/FollowJointTrajectory"
EVERY_NODE = {"/rosout": "rcl_interfaces/msg/Log", "/parameter_events": "rcl_interfaces/msg/ParameterEvent"}
TOPICS = EVERY_NODE | {
    "/sim_0/joint_states": "sensor_msgs/msg/JointState",
    "/sim_0/ball/odometry": "nav_msgs/msg/Odometry",
    "/sim_0/tf": "tf2_msgs/msg/TFMessage",
    "/sim_0/tf_static": "tf2_msgs/msg/TFMessage",
    "/sim_0/clock": "rosgraph_msgs/msg/Clock",
    "/sim_0/robot_description": "std_msgs/msg/String",
    "/sim_0/episode": "std_msgs/msg/UInt8MultiArray",
    "/sim_0/sensors": "std_msgs/msg/String",
}
CONTROL = [
    "GetSimulatorFeatures",
    "GetSimulationState",
    "SetSimulationState",
    "ResetSimulation",
    "StepSimulation",
    "GetEntities",
    "GetEntitiesStates",
    "GetEntityState",
    "SetEntityState",
    "GetSpawnables",
    "SpawnEntity",
    "DeleteEntity",
]
PARAMETERS = [
    "DescribeParameters",
    "GetParameters",
    "GetParameterTypes",
    "ListParameters",
    "SetParameters",
    "SetParametersAtomically",
]


def snake(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).strip("_")


def services_of_every_node(full_name: str) -> dict[str, str]:
    return {f"{full_name}/{snake(name)}": f"rcl_interfaces/srv/{name}" for name in PARAMETERS}


def tokens(robot: Robot, *kinds: EntityKind) -> list[Token]:
    if uses_rclpy():
        pytest.skip("rclpy does not show the tokens")
    return [token for token in robot.node.context.graph.tokens(*kinds) if token.node_namespace == "/sim_0"]


def visible(names_and_types: list[tuple[str, list[str]]]) -> dict[str, str]:
    """Leave out the hidden topics and services of actions, and the type descriptions that nodes of rclpy offer."""
    hidden = ("/_action/", "/get_type_description")
    return {name: kind for name, (kind,) in names_and_types if not any(part in name for part in hidden)}


def wait_for_latched(robot: Robot, kind: str, topic: str) -> Any:
    with robot.listening(kind, topic, LATE) as heard:
        robot.wait_until(lambda: bool(heard), topic)
    return heard[0]


@pytest.fixture
def description(robot: Robot) -> str:
    return str(wait_for_latched(robot, "std_msgs/msg/String", "robot_description").data)


def test_the_simulation_its_controllers_and_their_manager_are_nodes_of_its_namespace(robot: Robot) -> None:
    names = [name for name, namespace in robot.node.get_node_names_and_namespaces() if namespace == "/sim_0"]
    assert sorted(names) == sorted(["sim_0", "controller_manager", *TALOS.controllers])


def test_exactly_the_documented_topics_are_published_and_none_is_subscribed_to(robot: Robot) -> None:
    assert visible(robot.node.get_publisher_names_and_types_by_node("sim_0", "/sim_0")) == TOPICS
    assert visible(robot.node.get_subscriber_names_and_types_by_node("sim_0", "/sim_0")) == {}


def test_exactly_the_documented_services_are_offered(robot: Robot) -> None:
    offered = visible(robot.node.get_service_names_and_types_by_node("sim_0", "/sim_0"))
    control = {f"/sim_0/{snake(name)}": f"simulation_interfaces/srv/{name}" for name in CONTROL}
    assert offered == control | services_of_every_node("/sim_0/sim_0")


@pytest.mark.parametrize("name", TALOS.controllers)
def test_a_controller_has_the_topics_services_and_action_of_the_real_one(name: str, robot: Robot) -> None:
    node = robot.node
    assert visible(node.get_publisher_names_and_types_by_node(name, "/sim_0")) == EVERY_NODE | {
        f"/sim_0/{name}/controller_state": "control_msgs/msg/JointTrajectoryControllerState"
    }
    assert visible(node.get_subscriber_names_and_types_by_node(name, "/sim_0")) == {
        f"/sim_0/{name}/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
        f"/sim_0/{name}/speed_scaling_input": "control_msgs/msg/SpeedScalingFactor",
    }
    services = visible(node.get_service_names_and_types_by_node(name, "/sim_0"))
    own = {f"/sim_0/{name}/query_state": "control_msgs/srv/QueryTrajectoryState"}
    assert services == own | services_of_every_node(f"/sim_0/{name}")
    assert (f"/sim_0/{name}/follow_joint_trajectory", [ACTION]) in get_action_names_and_types(node)


def test_the_controllers_are_named_as_on_the_robot() -> None:
    limbs = ("arm_left", "arm_right", "leg_left", "leg_right", "torso", "head", "gripper_left", "gripper_right")
    assert set(TALOS.controllers) == {f"{limb}_controller" for limb in limbs}


def test_endpoints_have_the_quality_of_service_of_genuine_nodes(robot: Robot) -> None:
    expected = {
        "/rosout": ":1:,1000:,:10,0:,,",
        "/parameter_events": "::,1000:,:,:,,",
        "/sim_0/sim_0/set_parameters": "::,1000:,:,:,,",
        "/sim_0/reset_simulation": "::,10:,:,:,,",
        "/sim_0/robot_description": ":1:,1:,:,:,,",
        f"/sim_0/{ARM}/follow_joint_trajectory/_action/status": ":1:,1:,:,:,,",
        f"/sim_0/{ARM}/follow_joint_trajectory/_action/feedback": "::,10:,:,:,,",
        f"/sim_0/{ARM}/follow_joint_trajectory/_action/send_goal": "::,10:,:,:,,",
    }
    found = {token.name: token.qos for token in tokens(robot, EntityKind.PUBLISHER, EntityKind.SERVICE)}
    assert {name: found[name] for name in expected} == expected


def test_a_late_listener_gets_a_description_with_the_spoon_and_32_movable_joints(description: str) -> None:
    root = ET.fromstring(description)  # noqa: S314 - our own
    movable = {joint.get("name") for joint in root.iter("joint") if joint.get("type") in ("revolute", "prismatic")}
    assert movable == set(TALOS.joints)
    assert len(movable) == 32
    assert "spoon_link" in {link.get("name") for link in root.iter("link")}
    assert pinocchio.buildModelFromXML(description).nq == 32


def test_static_and_moving_transforms_connect_every_link_to_world(robot: Robot, description: str) -> None:
    static = wait_for_latched(robot, "tf2_msgs/msg/TFMessage", "tf_static")
    with robot.listening("tf2_msgs/msg/TFMessage", "tf") as moving:
        robot.put_into(PAUSED)
        robot.step(10)
        robot.wait_until(lambda: bool(moving), "moving transforms")
    transforms = [*static.transforms, *moving[0].transforms]
    parents = {each.child_frame_id: each.header.frame_id for each in transforms}
    assert len(parents) == len(transforms)
    for link in ET.fromstring(description).iter("link"):  # noqa: S314 - our own
        frame = link.get("name", "")
        while frame in parents:
            frame = parents[frame]
        assert frame == "world", link.get("name")
