"""What a simulation offers, as `ros2 node info` and late subscribers see it."""

import xml.etree.ElementTree as ET
from typing import Any

import pinocchio
import pytest

from tests.integration.robot import CONFIG, PAUSED, Robot
from throwcollect.robots.talos import CONTROLLERS, JOINTS
from throwcollect.ros import DurabilityPolicy, QoSProfile
from throwcollect.ros.embedded.action import get_action_server_names_and_types_by_node

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ACTION = "control_msgs/action/FollowJointTrajectory"
TOPICS = {
    "/rosout": "rcl_interfaces/msg/Log",
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
    "/sim_0/joint_states": "sensor_msgs/msg/JointState",
    "/sim_0/ball/odometry": "nav_msgs/msg/Odometry",
    "/sim_0/tf": "tf2_msgs/msg/TFMessage",
    "/sim_0/tf_static": "tf2_msgs/msg/TFMessage",
    "/sim_0/clock": "rosgraph_msgs/msg/Clock",
    "/sim_0/robot_description": "std_msgs/msg/String",
    "/sim_0/episode": "std_msgs/msg/UInt8MultiArray",
}
SERVICES = {
    "get_simulator_features": "simulation_interfaces/srv/GetSimulatorFeatures",
    "get_simulation_state": "simulation_interfaces/srv/GetSimulationState",
    "set_simulation_state": "simulation_interfaces/srv/SetSimulationState",
    "reset_simulation": "simulation_interfaces/srv/ResetSimulation",
    "step_simulation": "simulation_interfaces/srv/StepSimulation",
    "get_entity_state": "simulation_interfaces/srv/GetEntityState",
    "set_entity_state": "simulation_interfaces/srv/SetEntityState",
    "sim_0/describe_parameters": "rcl_interfaces/srv/DescribeParameters",
    "sim_0/get_parameters": "rcl_interfaces/srv/GetParameters",
    "sim_0/get_parameter_types": "rcl_interfaces/srv/GetParameterTypes",
    "sim_0/list_parameters": "rcl_interfaces/srv/ListParameters",
    "sim_0/set_parameters": "rcl_interfaces/srv/SetParameters",
    "sim_0/set_parameters_atomically": "rcl_interfaces/srv/SetParametersAtomically",
}


def visible(names_and_types: list[tuple[str, list[str]]]) -> dict[str, str]:
    """Without what makes up actions, which ROS hides."""
    return {name: kind for name, (kind,) in names_and_types if "/_action/" not in name}


def latched(robot: Robot, kind: str, topic: str) -> Any:
    with robot.listening(kind, topic, LATE) as heard:
        robot.wait_until(lambda: bool(heard), topic)
    return heard[0]


@pytest.fixture
def description(robot: Robot) -> str:
    return str(latched(robot, "std_msgs/msg/String", "robot_description").data)


def test_the_node_has_the_name_of_its_namespace(robot: Robot) -> None:
    assert ("sim_0", "/sim_0") in robot.node.get_node_names_and_namespaces()


def test_exactly_the_documented_topics_are_published(robot: Robot) -> None:
    states = {
        f"/sim_0/{name}/controller_state": "control_msgs/msg/JointTrajectoryControllerState" for name in CONTROLLERS
    }
    published = robot.node.get_publisher_names_and_types_by_node("sim_0", "/sim_0")
    assert visible(published) == TOPICS | states


def test_exactly_the_trajectory_topics_are_subscribed_to(robot: Robot) -> None:
    subscribed = robot.node.get_subscriber_names_and_types_by_node("sim_0", "/sim_0")
    assert visible(subscribed) == {
        f"/sim_0/{name}/joint_trajectory": "trajectory_msgs/msg/JointTrajectory" for name in CONTROLLERS
    }


def test_exactly_the_documented_services_are_offered(robot: Robot) -> None:
    offered = robot.node.get_service_names_and_types_by_node("sim_0", "/sim_0")
    assert visible(offered) == {f"/sim_0/{name}": kind for name, kind in SERVICES.items()}


def test_the_eight_actions_are_named_as_on_the_robot(robot: Robot) -> None:
    actions = dict(get_action_server_names_and_types_by_node(robot.node, "sim_0", "/sim_0"))
    limbs = ("arm_left", "arm_right", "leg_left", "leg_right", "torso", "head", "gripper_left", "gripper_right")
    assert actions == {f"/sim_0/{limb}_controller/follow_joint_trajectory": [ACTION] for limb in limbs}


def test_a_late_listener_gets_a_description_with_the_spoon_and_32_movable_joints(description: str) -> None:
    root = ET.fromstring(description)  # noqa: S314 - our own
    movable = {joint.get("name") for joint in root.iter("joint") if joint.get("type") in ("revolute", "prismatic")}
    assert movable == set(JOINTS)
    assert len(movable) == 32
    assert "spoon_link" in {link.get("name") for link in root.iter("link")}
    assert pinocchio.buildModelFromXML(description).nq == 32


def test_every_link_has_its_place_below_world_by_static_and_moving_transforms(robot: Robot, description: str) -> None:
    static = latched(robot, "tf2_msgs/msg/TFMessage", "tf_static")
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


def test_the_base_stands_where_the_configuration_says(robot: Robot) -> None:
    static = latched(robot, "tf2_msgs/msg/TFMessage", "tf_static")
    (base,) = [each.transform.translation for each in static.transforms if each.header.frame_id == "world"]
    assert (base.x, base.y, base.z) == (0.0, 0.0, CONFIG.robot.base_height_m)
