"""A bridge on genuine rclpy, beside a node that has one of everything."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from tests.integration.robot import FOUND_BY_OTHERS_S, ON_DDS, discovery_server
from tests.unit.serve.rosbridge.conftest import Party, wait_for, wait_for_robot
from tests.unit.serve.rosbridge.robot import Robot
from throwcollect.ros import Context, ExternalShutdownException, Node, SingleThreadedExecutor, init
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey
from throwcollect.serve.rosbridge import Bridge


def test_rosbridge_passes_topics_services_and_actions_both_ways() -> None:
    with discovery_server() if ON_DDS else router("tcp/127.0.0.1:0") as endpoint:
        connection = Connection(endpoint, RunKey(Path("/no/key")), middleware=Middleware.of_process())
        context = Context()
        init(context=context, connection=connection)
        node = Node("other", context=context)
        robot = Robot(node)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)

        def spin() -> None:
            try:
                executor.spin()
            except ExternalShutdownException:
                return

        thread = threading.Thread(target=spin)
        thread.start()
        bridge = Bridge(connection)
        try:
            _try_everything(Party(bridge), robot)
        finally:
            bridge.close()
            context.try_shutdown()
            thread.join()


def _try_everything(party: Party, robot: Robot) -> None:
    wait_for_robot(party)
    party.ask(op="subscribe", id="w", topic="words")
    assert party.next(op="publish")["msg"] == {"data": "hello"}
    party.ask(op="unsubscribe", topic="words")
    party.ask(op="subscribe", topic="/states", compression="cbor")
    assert party.next(op="publish", topic="/states")["msg"]["position"].tag == 86
    party.ask(op="unsubscribe", topic="/states")
    assert party.call("/lamp", data=True) == {"success": True, "message": "switched"}
    assert party.call("/rosapi/get_param", name="/other:mass") == {"value": "0.5"}

    party.ask(op="advertise_service", service="/clock", type="std_srvs/SetBool")
    party.ask(op="advertise", topic="/orders", type="std_msgs/String")
    wait_for(lambda: "/clock" in party.call("rosapi/services")["services"])
    time.sleep(FOUND_BY_OTHERS_S)
    party.ask(op="publish", topic="/orders", msg={"data": "what time is it"})
    asked = party.next(op="call_service", service="/clock")
    party.ask(op="service_response", id=asked["id"], service="/clock", values={"message": "late"}, result=True)
    wait_for(lambda: robot.clock)
    assert (robot.orders, robot.clock[0].message) == (["what time is it"], "late")

    goal = {"id": "g", "action": "/follow", "action_type": "control_msgs/FollowJointTrajectory"}
    party.ask(op="send_action_goal", **goal, args={"trajectory": {"joint_names": ["a"]}}, feedback=True)
    assert party.next(op="action_result")["values"] == {"error_code": 0, "error_string": "done"}

    party.ask(op="advertise_action", action="/swing", type="control_msgs/FollowJointTrajectory")
    wait_for(lambda: "/swing" in party.call("rosapi/action_servers")["action_servers"])
    time.sleep(FOUND_BY_OTHERS_S)
    party.ask(op="send_action_goal", **{**goal, "action": "/swing"})
    asked = party.next(op="send_action_goal")
    party.ask(op="action_result", id=asked["id"], action="/swing", values={"error_string": "swung"}, result=True)
    assert party.next(op="action_result")["values"] == {"error_code": 0, "error_string": "swung"}
