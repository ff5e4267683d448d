"""What action servers and clients of the embedded backend do beyond rclpy."""

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
    assert client.wait_for_server(timeout_sec=30)
    node = rig.node("observer")
    feedback, status = ("/arm/follow_joint_trajectory/_action/" + topic for topic in ("feedback", "status"))
    _, theirs = rig.result(client.send_goal_async(goal("a"))), rig.result(client.send_goal_async(goal("b")))
    assert (node.count_subscribers(feedback), node.count_subscribers(status)) == (0, 0)
    assert rig.spin(lambda: theirs.status != GoalStatus.STATUS_UNKNOWN)
    assert (node.count_subscribers(feedback), node.count_subscribers(status)) == (0, 1)
