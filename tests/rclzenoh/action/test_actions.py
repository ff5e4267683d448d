"""What action servers and clients of the embedded backend do beyond rclpy."""

import pytest

from rclzenoh.interfaces import get_action
from rclzenoh.interfaces.msg import GoalStatus
from throwcollect.ros import ActionClient, ActionServer, Future

FJT = get_action("control_msgs/action/FollowJointTrajectory")


def goal(*joints):
    goal = FJT.Goal()
    goal.trajectory.joint_names = list(joints)
    return goal


def test_a_client_subscribes_only_to_topics_that_it_uses(rig):
    async def execute(_handle):
        return await Future()

    ActionServer(rig.node("server"), FJT, "/arm/follow_joint_trajectory", execute)
    client = ActionClient(rig.node("client"), FJT, "/arm/follow_joint_trajectory")
    assert client.wait_for_server(timeout_sec=5)
    node = rig.node("observer")
    feedback, status = ("/arm/follow_joint_trajectory/_action/" + topic for topic in ("feedback", "status"))
    _, theirs = rig.result(client.send_goal_async(goal("a"))), rig.result(client.send_goal_async(goal("b")))
    assert (node.count_subscribers(feedback), node.count_subscribers(status)) == (0, 0)
    assert rig.spin(lambda: theirs.status != GoalStatus.STATUS_UNKNOWN)
    assert (node.count_subscribers(feedback), node.count_subscribers(status)) == (0, 1)


def test_a_handle_may_end_a_goal_without_an_execute_callback(rig):
    handles = []
    node = rig.node("server")
    ActionServer(node, FJT, "/act", handle_accepted_callback=handles.append)
    client = ActionClient(rig.node("client"), FJT, "/act")
    assert client.wait_for_server(5)
    theirs = rig.result(client.send_goal_async(goal("a")))
    result = theirs.get_result_async()
    assert rig.spin(lambda: handles)
    handles[0].execute()
    handles[0].succeed(FJT.Result(error_string="directly"))
    assert rig.result(result).result.error_string == "directly"
    with pytest.raises(RuntimeError, match="is succeeded and cannot be aborted"):
        handles[0].abort()


def test_the_first_result_of_a_goal_counts(rig):
    def execute(handle):
        handle.succeed(FJT.Result(error_string="first"))
        return FJT.Result(error_string="second")

    ActionServer(rig.node("server"), FJT, "/act", execute)
    client = ActionClient(rig.node("client"), FJT, "/act")
    assert client.wait_for_server(5)
    handle = rig.result(client.send_goal_async(goal("a")))
    assert [rig.result(handle.get_result_async()).result.error_string for _ in range(2)] == ["first", "first"]
