"""roslibpy, by which people reach ROS from Python without having it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import roslibpy
from tests.unit.serve.rosbridge.conftest import wait_for
from tests.unit.serve.rosbridge.robot import Robot, SetBool


@pytest.fixture
def ros(url: str) -> Iterator[Any]:
    # The default transport, Twisted, can be started only once in a process.
    ros = roslibpy.Ros(url, transport="asyncio")
    ros.run(10)
    yield ros
    ros.close()


def test_roslibpy_hears_speaks_calls_offers_and_sends_goals(ros: Any, robot: Robot) -> None:
    assert ros.get_topic_type("/words") == "std_msgs/msg/String"
    assert ros.get_nodes() == ["/other"]
    assert roslibpy.Param(ros, "/other:mass").get(timeout=10) == 0.5

    heard: list[str] = []
    words = roslibpy.Topic(ros, "/words", "std_msgs/String")
    words.subscribe(lambda message: heard.append(message["data"]))
    wait_for(lambda: heard)
    words.unsubscribe()
    assert heard[0] == "hello"

    lamp = roslibpy.Service(ros, "/lamp", "std_srvs/SetBool")
    assert lamp.call({"data": True}, timeout=10) == {"success": True, "message": "switched"}
    with pytest.raises(Exception, match="no node offers a service /nobody"):
        roslibpy.Service(ros, "/nobody", "std_srvs/SetBool").call({}, timeout=10)

    def answer(request: Any, response: Any) -> bool:
        response["success"], response["message"] = request["data"], "from roslibpy"
        return True

    roslibpy.Service(ros, "/clock", "std_srvs/SetBool").advertise(answer)
    roslibpy.Topic(ros, "/orders", "std_msgs/String").publish({"data": "what time is it"})
    wait_for(lambda: robot.clock)
    assert (robot.orders, robot.clock) == (
        ["what time is it"],
        [SetBool.Response(success=True, message="from roslibpy")],
    )

    results: list[Any] = []
    feedback: list[Any] = []
    action = roslibpy.ActionClient(ros, "/follow", "control_msgs/action/FollowJointTrajectory")
    goal = {"trajectory": {"joint_names": ["a"]}}
    done = action.send_goal(roslibpy.Goal(goal), results.append, feedback.append, results.append)
    action.wait_goal(done, 10)
    assert feedback[0]["joint_names"] == ["a"]
    assert results[0]["status"] == roslibpy.GoalStatus.SUCCEEDED
    assert results[0]["values"] == {"error_code": 0, "error_string": "done"}
