"""Action servers and clients."""

import numpy as np
import pytest

from tests.contract.rig import ON_RCLPY, choose_words, names_of
from throwcollect.ros import (
    ActionClient,
    ActionServer,
    CancelResponse,
    DurabilityPolicy,
    Future,
    GoalResponse,
    QoSProfile,
    get_action,
    get_action_names_and_types,
    get_message,
    get_service,
)

UNKNOWN = np.full(16, 120, dtype=np.uint8)
FOLLOW = "control_msgs/action/FollowJointTrajectory"
FJT = get_action(FOLLOW)
CancelGoal = get_service("action_msgs/srv/CancelGoal")
Uuid = get_message("unique_identifier_msgs/msg/UUID")
GoalStatus = get_message("action_msgs/msg/GoalStatus")
StatusArray = get_message("action_msgs/msg/GoalStatusArray")


def goal(*joints):
    goal = FJT.Goal()
    goal.trajectory.joint_names = list(joints)
    return goal


class Controller:
    """Server that accepts goals with joints and carries them out when told to."""

    def __init__(self, node, **options):
        self.handles, self.orders = [], {}
        self.server = ActionServer(
            node,
            FJT,
            "/arm/follow_joint_trajectory",
            self.execute,
            goal_callback=self.on_goal,
            cancel_callback=self.on_cancel,
            **options,
        )

    def on_goal(self, goal):
        return GoalResponse.ACCEPT if goal.trajectory.joint_names else GoalResponse.REJECT

    def on_cancel(self, handle):
        return CancelResponse.REJECT if handle.request.trajectory.joint_names == ["stubborn"] else CancelResponse.ACCEPT

    async def execute(self, handle):
        self.handles.append(handle)
        order = self.orders[bytes(handle.goal_id.uuid)] = Future()
        end, result = await order
        getattr(handle, end)()
        return result

    def end(self, handle, how, **result):
        self.orders[bytes(handle.goal_id.uuid)].set_result((how, FJT.Result(**result)))


@pytest.fixture
def controller(rig):
    return Controller(rig.node("server"))


@pytest.fixture
def client(rig, controller):
    client = ActionClient(rig.node("client"), FJT, "/arm/follow_joint_trajectory")
    assert client.wait_for_server(timeout_sec=30)
    return client


def send(rig, controller, client, *joints, **options):
    """Send a goal and wait until it is being executed; returns both handles."""
    known = len(controller.handles)
    accepted = rig.result(client.send_goal_async(goal(*joints), **options))
    assert accepted.accepted
    assert rig.spin(lambda: len(controller.handles) == known + 1)
    return accepted, controller.handles[-1]


def test_a_goal_is_accepted_executed_and_reached_with_feedback(rig, controller, client):
    feedback = []
    theirs, ours = send(rig, controller, client, "a", feedback_callback=feedback.append)
    assert ours.request.trajectory.joint_names == ["a"]
    assert ours.goal_id == theirs.goal_id
    assert theirs.stamp.sec > 1_600_000_000
    result = theirs.get_result_async()
    ours.publish_feedback(FJT.Feedback(joint_names=["a"]))
    assert rig.spin(lambda: feedback)
    assert feedback[0].feedback.joint_names == ["a"]
    assert not result.done()
    controller.end(ours, "succeed", error_string="done")
    response = rig.result(result)
    assert (response.status, response.result.error_string) == (GoalStatus.STATUS_SUCCEEDED, "done")


def test_a_client_can_request_a_result_several_times(rig, controller, client):
    theirs, ours = send(rig, controller, client, "a")
    early = [theirs.get_result_async(), theirs.get_result_async()]
    controller.end(ours, "abort", error_code=-4)
    results = [rig.result(future) for future in (*early, theirs.get_result_async())]
    assert [(r.status, r.result.error_code) for r in results] == [(GoalStatus.STATUS_ABORTED, -4)] * 3


def test_a_server_can_reject_a_goal(rig, controller, client):
    handle = rig.result(client.send_goal_async(goal()))
    assert not handle.accepted
    assert rig.result(handle.get_result_async()).status == GoalStatus.STATUS_UNKNOWN


def test_a_goal_with_a_repeated_identifier_is_rejected(rig, controller, client):
    send_goal = FJT.Impl.SendGoalService
    service = rig.node("repeating").create_client(send_goal, "/arm/follow_joint_trajectory/_action/send_goal")
    assert service.wait_for_service(30)
    request = send_goal.Request(goal_id=Uuid(uuid=np.arange(16, dtype=np.uint8)), goal=goal("a"))
    assert [rig.result(service.call_async(request)).accepted for _ in range(2)] == [True, False]


def test_the_result_of_an_unknown_goal_is_unknown(rig, controller, client):
    send(rig, controller, client, "a")
    get_result = FJT.Impl.GetResultService
    service = rig.node("curious").create_client(get_result, "/arm/follow_joint_trajectory/_action/get_result")
    assert service.wait_for_service(30)
    request = get_result.Request(goal_id=Uuid(uuid=UNKNOWN))
    assert rig.result(service.call_async(request)).status == GoalStatus.STATUS_UNKNOWN


def test_a_client_can_cancel_a_goal(rig, controller, client):
    theirs, ours = send(rig, controller, client, "a")
    response = rig.result(theirs.cancel_goal_async())
    assert response.return_code == CancelGoal.Response.ERROR_NONE
    assert [info.goal_id for info in response.goals_canceling] == [theirs.goal_id]
    assert ours.is_cancel_requested
    controller.end(ours, "canceled")
    assert rig.result(theirs.get_result_async()).status == GoalStatus.STATUS_CANCELED
    assert rig.result(theirs.cancel_goal_async()).return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED


def test_a_server_can_refuse_to_cancel_a_goal(rig, controller, client):
    theirs, ours = send(rig, controller, client, "stubborn")
    response = rig.result(theirs.cancel_goal_async())
    # rclpy leaves the code unchanged; rclcpp and the embedded backend set it if all goals refuse.
    code = CancelGoal.Response.ERROR_NONE if ON_RCLPY else CancelGoal.Response.ERROR_REJECTED
    assert (response.return_code, response.goals_canceling) == (code, [])
    assert ours.status == GoalStatus.STATUS_EXECUTING


def test_an_empty_request_cancels_all_goals_and_an_unknown_id_is_an_error(rig, controller, client):
    handles = [send(rig, controller, client, "a")[0] for _ in range(3)]
    node = rig.node("canceler")
    service = node.create_client(CancelGoal, "/arm/follow_joint_trajectory/_action/cancel_goal")
    assert service.wait_for_service(30)
    unknown = CancelGoal.Request()
    unknown.goal_info.goal_id.uuid = UNKNOWN
    assert rig.result(service.call_async(unknown)).return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
    response = rig.result(service.call_async(CancelGoal.Request()))
    assert [info.goal_id for info in response.goals_canceling] == [handle.goal_id for handle in handles]


def test_a_result_is_forgotten_after_its_timeout(rig):
    controller = Controller(rig.node("server"), result_timeout=0.05)
    client = ActionClient(rig.node("client"), FJT, "/arm/follow_joint_trajectory")
    assert client.wait_for_server(timeout_sec=30)
    theirs, ours = send(rig, controller, client, "a")
    controller.end(ours, "succeed")
    assert rig.result(theirs.get_result_async()).status == GoalStatus.STATUS_SUCCEEDED
    rig.rest(0.1)
    assert rig.result(theirs.get_result_async()).status == GoalStatus.STATUS_UNKNOWN
    assert ours.status == GoalStatus.STATUS_UNKNOWN


def test_a_late_subscriber_gets_the_status_of_all_goals(rig, controller, client):
    _, first = send(rig, controller, client, "a")
    send(rig, controller, client, "b")
    controller.end(first, "succeed")
    assert rig.spin(lambda: first.status == GoalStatus.STATUS_SUCCEEDED)
    heard = []
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    topic = "/arm/follow_joint_trajectory/_action/status"
    rig.node("late").create_subscription(StatusArray, topic, heard.append, qos)
    assert rig.spin(lambda: heard)
    assert [status.status for status in heard[-1].status_list] == [4, 2]


def test_an_execute_callback_that_forgets_the_end_aborts_the_goal(rig):
    server = ActionServer(rig.node("server"), FJT, "/act", lambda _handle: FJT.Result(error_string="forgot"))
    client = ActionClient(rig.node("client"), FJT, "/act")
    assert client.wait_for_server(30)
    handle = rig.result(client.send_goal_async(goal("a")))
    response = rig.result(handle.get_result_async())
    assert (response.status, response.result.error_string) == (GoalStatus.STATUS_ABORTED, "forgot")
    server.destroy()
    assert rig.spin(lambda: not client.server_is_ready())


def test_an_execute_callback_that_fails_aborts_the_goal(rig):
    def fail(_handle):
        raise LookupError("callback failed")

    ActionServer(rig.node("server"), FJT, "/act", fail)
    client = ActionClient(rig.node("client"), FJT, "/act")
    assert client.wait_for_server(30)
    future = client.send_goal_async(goal("a"))
    if not ON_RCLPY:
        # rclpy logs the exception and goes on; the embedded backend raises it, as for every callback.
        with pytest.raises(LookupError, match="callback failed"):
            rig.rest(5)
    handle = rig.result(future)
    assert rig.result(handle.get_result_async()).status == GoalStatus.STATUS_ABORTED


def test_goals_and_feedback_of_a_wrong_type_are_refused(rig, controller, client):
    _, ours = send(rig, controller, client, "a")
    refused = choose_words(embedded="FollowJointTrajectory.* cannot be serialised", rclpy="^$")
    with pytest.raises(TypeError, match=refused):
        client.send_goal_async(FJT.Result())
    with pytest.raises(TypeError, match=refused):
        ours.publish_feedback(FJT.Goal())


def test_actions_are_found_in_the_graph(rig, controller, client):
    node = rig.node("observer")
    expected = [("/arm/follow_joint_trajectory", [FOLLOW])]
    assert rig.sees(lambda: {"server", "client"} <= set(names_of(node)))
    assert rig.sees(lambda: get_action_names_and_types(node) == expected)
