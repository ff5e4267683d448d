"""ROS#, by which Unity reaches ROS: frames of its RosBridgeClient 2.2.0, as they were recorded.

It sends JSON in binary frames. In every frame that it gets, it takes bytes for characters, and it looks up fields
without asking whether they are there: what it finds amiss ends its thread that listens.
"""

from __future__ import annotations

import json
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for

from throwcollect.ros import ActionServer, Node, get_action, get_message, get_service

String: Any = get_message("std_msgs/msg/String")
Scan: Any = get_message("sensor_msgs/msg/LaserScan")
SetBool: Any = get_service("std_srvs/srv/SetBool")
FJT: Any = get_action("control_msgs/action/FollowJointTrajectory")

ADVERTISE = b'{"topic":"/sharp/words","type":"std_msgs/msg/String","op":"advertise","id":"/sharp/words"}'
UNADVERTISE = b'{"topic":"/sharp/words","op":"unadvertise","id":"/sharp/words"}'
PUBLISH = rb'{"topic":"/sharp/words","msg":{"data":"gr\u00FC\u00DFe \u00B0 \u5EA6"},"op":"publish","id":"/sharp/words"}'
ADVERTISE_SCAN = b'{"topic":"/sharp/scan","type":"sensor_msgs/msg/LaserScan","op":"advertise","id":"/sharp/scan"}'
SCAN = (
    b'{"topic":"/sharp/scan","msg":{"header":{"stamp":{"sec":0,"nanosec":0},"frame_id":""},"angle_min":0,"angle_max":0,'
    b'"angle_increment":0,"time_increment":0,"scan_time":0,"range_min":0,"range_max":30,'
    b'"ranges":[1.5,0.100000001,2.99999989E-08],"intensities":[]},"op":"publish","id":"/sharp/scan"}'
)
CALL = (
    b'{"service":"/sharp/call_my_lamp","args":{"data":true},"fragment_size":2147483647,"compression":"none",'
    b'"op":"call_service","id":"/sharp/call_my_lamp:0"}'
)
OFFER = b'{"type":"std_srvs/srv/SetBool","service":"/sharp/lamp","op":"advertise_service","id":null}'
RESPOND = (
    b'{"service":"/sharp/lamp","values":{"success":true,"message":"from ROS#"},"result":true,"op":"service_response",'
    b'"id":"ID"}'
)
WITHDRAW = b'{"service":"/sharp/lamp","op":"unadvertise_service","id":null}'
SEND_GOAL = (
    b'{"action":"/partner/follow","action_type":"control_msgs/action/FollowJointTrajectory","args":{"trajectory":{"header":'
    b'{"stamp":{"sec":0,"nanosec":0},"frame_id":""},"joint_names":["arm_right_1_joint","arm_right_2_joint",'
    b'"arm_right_3_joint","arm_right_4_joint","arm_right_5_joint","arm_right_6_joint","arm_right_7_joint"],"points":'
    b'[{"positions":[-0.10000000000000001,-0.40000000000000002,0.10000000000000001,-1.5,0.10000000000000001,'
    b'0.10000000000000001,0.10000000000000001],"velocities":[],"accelerations":[],"effort":[],"time_from_start":'
    b'{"sec":1,"nanosec":0}}]},"multi_dof_trajectory":{"header":{"stamp":{"sec":0,"nanosec":0},"frame_id":""},'
    b'"joint_names":[],"points":[]},"path_tolerance":[],"component_path_tolerance":[],"goal_tolerance":[],'
    b'"component_goal_tolerance":[],"goal_time_tolerance":{"sec":0,"nanosec":0}},"feedback":true,'
    b'"fragment_size":2147483647,"compression":"none","op":"send_action_goal","id":"/partner/follow:0"}'
)
CANCEL_GOAL = b'{"action":"/partner/follow","op":"cancel_action_goal","id":"/partner/follow:0"}'
GET_NAME = (
    b'{"service":"/rosapi/get_param","args":{"name":"talos:file_server2","default_value":"file_server2"},'
    b'"fragment_size":2147483647,"compression":"none","op":"call_service","id":"/rosapi/get_param:0"}'
)
GET_DESCRIPTION = (
    b'{"service":"/rosapi/get_param","args":{"name":"sim_0/sim_0:robot_description","default_value":"default_value"},'
    b'"fragment_size":2147483647,"compression":"none","op":"call_service","id":"/rosapi/get_param:1"}'
)
HAS = (
    b'{"service":"/rosapi/has_param","args":{"name":"/nobody:ball.mass_kg"},"fragment_size":2147483647,'
    b'"compression":"none","op":"call_service","id":"/rosapi/has_param:1"}'
)

NEEDED = {
    "publish": {"topic", "msg"},
    "service_response": {"id", "values"},
    "call_service": {"id", "service", "args"},
    "send_action_goal": {"id", "action", "action_type", "args"},
    "cancel_action_goal": {"id", "action"},
    "action_feedback": {"id", "action", "values"},
    "action_result": {"id", "action", "values", "status", "result"},
}
"""Fields that ROS# looks up in each operation that it gets."""


def hear(party: Party, op: str) -> Any:
    """The next frame with this operation, as ROS# reads it."""
    fields = party.next(op=op)
    assert NEEDED[op] <= set(fields)
    assert all(isinstance(frame, str) and frame.isascii() for frame in party.frames)
    return fields


def test_nodes_hear_messages_that_ros_sharp_publishes(party: Party, node: Node) -> None:
    words: list[Any] = []
    scans: list[Any] = []
    node.create_subscription(String, "/sharp/words", words.append, 10)
    node.create_subscription(Scan, "/sharp/scan", scans.append, 10)
    for advertise, topic, publish, heard in (
        (ADVERTISE, "/sharp/words", PUBLISH, words),
        (ADVERTISE_SCAN, "/sharp/scan", SCAN, scans),
    ):
        party.client.receive(advertise)
        wait_for(lambda topic=topic: node.count_publishers(topic))  # type: ignore[misc]
        # A message is lost if the subscription has not found the publisher yet, so it is sent again.
        wait_for(lambda: party.client.receive(publish) or heard)  # noqa: B023
    assert words[0].data == "grüße ° 度"
    assert scans[0].ranges.tolist() == [1.5, pytest.approx(0.1), pytest.approx(3e-8)]
    assert scans[0].range_max == 30
    party.client.receive(UNADVERTISE)
    wait_for(lambda: not node.count_publishers("/sharp/words"))


def test_ros_sharp_calls_and_offers_services(party: Party, node: Node) -> None:
    lamp = node.create_client(SetBool, "/sharp/lamp")

    async def ask_back(request: Any, response: Any) -> Any:
        answer = await lamp.call_async(SetBool.Request(data=request.data))
        response.success, response.message = answer.success, answer.message
        return response

    node.create_service(SetBool, "/sharp/call_my_lamp", ask_back)
    party.client.receive(OFFER)
    wait_for(lambda: "/sharp/call_my_lamp" in party.call("rosapi/services")["services"])
    assert lamp.wait_for_service(30)
    party.client.receive(CALL)
    asked = hear(party, "call_service")
    assert (asked["service"], asked["args"]) == ("/sharp/lamp", {"data": True})
    party.client.receive(RESPOND.replace(b"ID", asked["id"].encode()))
    answer = hear(party, "service_response")
    assert answer["id"] == "/sharp/call_my_lamp:0"
    assert answer["values"] == {"success": True, "message": "from ROS#"}
    party.client.receive(WITHDRAW)
    wait_for(lambda: not lamp.service_is_ready())


def test_ros_sharp_sends_a_goal_and_gets_feedback_and_result(party: Party, node: Node) -> None:
    def follow(handle: Any) -> Any:
        handle.publish_feedback(FJT.Feedback(joint_names=handle.request.trajectory.joint_names))
        handle.succeed()
        return FJT.Result(error_string="done")

    ActionServer(node, FJT, "/partner/follow", follow)
    wait_for(lambda: "/partner/follow" in party.call("rosapi/action_servers")["action_servers"])
    party.client.receive(SEND_GOAL)
    assert hear(party, "action_feedback")["values"]["joint_names"][6] == "arm_right_7_joint"
    result = hear(party, "action_result")
    assert (result["id"], result["status"], result["result"]) == ("/partner/follow:0", 4, True)
    party.client.receive(CANCEL_GOAL)
    assert "no goal with the id /partner/follow:0 is under way" in party.next(op="status")["msg"]


def test_ros_sharp_imports_the_description_of_a_robot(party: Party, node: Node) -> None:
    urdf = '<?xml version="1.0"?>\n<robot name="grün"/>'
    node.declare_parameter("robot_description", urdf)
    wait_for(lambda: "/other/get_parameters" in party.call("rosapi/services")["services"])
    party.client.receive(GET_NAME)
    assert json.loads(hear(party, "service_response")["values"]["value"]) == "file_server2"
    party.client.receive(GET_DESCRIPTION.replace(b"sim_0/sim_0", b"other"))
    value = hear(party, "service_response")["values"]["value"]
    # ROS# decodes only quotation marks and ends of lines of JSON.
    assert value[1:-1].replace('\\"', '"').replace("\\n", "\n") == urdf
    party.client.receive(HAS)
    assert hear(party, "service_response")["values"] == {"exists": False}
