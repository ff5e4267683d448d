"""What action servers and clients of the embedded backend do beyond rclpy."""

from rclzenoh.interfaces import get_action
from throwcollect.ros import ActionClient, ActionServer, Future

FJT = get_action("control_msgs/action/FollowJointTrajectory")


def goal(*joints):
    goal = FJT.Goal()
    goal.trajectory.joint_names = list(joints)
    return goal


def test_a_client_subscribes_to_feedback_with_its_first_callback(rig):
    async def execute(_handle):
        return await Future()

    ActionServer(rig.node("server"), FJT, "/arm/follow_joint_trajectory", execute)
    client = ActionClient(rig.node("client"), FJT, "/arm/follow_joint_trajectory")
    assert client.wait_for_server(timeout_sec=30)
    node = rig.node("observer")
    feedback = "/arm/follow_joint_trajectory/_action/feedback"
    assert rig.result(client.send_goal_async(goal("a"))).accepted
    assert node.count_subscribers(feedback) == 0
    assert rig.result(client.send_goal_async(goal("b"), feedback_callback=print)).accepted
    assert rig.spin(lambda: node.count_subscribers(feedback) == 1)
