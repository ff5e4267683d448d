"""Goals that a client sends to actions, and actions that it offers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for

from throwcollect.ros import ActionClient, ActionServer, CancelResponse, Future, GoalResponse, Node, get_action
from throwcollect.serve.rosbridge import Bridge

FJT: Any = get_action("control_msgs/action/FollowJointTrajectory")
KIND = "control_msgs/FollowJointTrajectory"
CANCELED, ABORTED = 5, 6


class Arm:
    """An action of a node; a goal without joints is rejected, one with the joint ``wait`` ends when it is cancelled."""

    def __init__(self, node: Node) -> None:
        self.cancelled = Future()
        self.server = ActionServer(
            node, FJT, "/follow", self.execute, goal_callback=self.consider, cancel_callback=self.cancel
        )

    def consider(self, goal: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if goal.trajectory.joint_names else GoalResponse.REJECT

    def cancel(self, _handle: Any) -> CancelResponse:
        self.cancelled.set_result(None)
        return CancelResponse.ACCEPT

    async def execute(self, handle: Any) -> Any:
        handle.publish_feedback(FJT.Feedback(joint_names=handle.request.trajectory.joint_names))
        if "wait" in handle.request.trajectory.joint_names:
            await self.cancelled
            handle.canceled()
        else:
            handle.succeed()
        return FJT.Result(error_string="done")


@pytest.fixture
def arm(node: Node, party: Party) -> Arm:
    arm = Arm(node)
    wait_for(lambda: "/follow" in party.call("rosapi/action_servers")["action_servers"])
    return arm


def send(party: Party, *joints: str, number: str = "g", **more: Any) -> None:
    goal = {"trajectory": {"joint_names": joints}}
    fields = {"id": number, "action": "follow", "action_type": KIND, "args": goal, **more}
    party.ask(op="send_action_goal", **fields)


def test_a_client_can_cancel_a_goal_and_gets_no_unwanted_feedback(party: Party, arm: Arm) -> None:
    send(party, "wait")
    party.ask(op="cancel_action_goal", id="g", action="follow")
    assert party.next(op="action_result")["status"] == CANCELED
    assert [each for each in party.got() if each["op"] == "action_feedback"] == []
    party.ask(op="cancel_action_goal", id="g", action="follow")
    assert "no goal with the id g is under way" in party.next(op="status")["msg"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({}, "/follow: the goal was rejected, and /rosout has the reason (docs/ros.md)"),
        ({"action": "/nobody"}, "no node offers an action /nobody"),
    ],
)
def test_a_goal_that_cannot_be_sent_fails_with_the_reason(party: Party, arm: Arm, asked: Any, said: str) -> None:
    send(party, **asked)
    answer = party.next(op="action_result", id="g")
    assert (answer["result"], answer["status"]) == (False, 0)
    assert said in answer["values"]


def test_a_goal_fails_when_its_action_disappears(party: Party, arm: Arm) -> None:
    send(party, "wait", feedback=True)
    party.next(op="action_feedback")
    arm.server.destroy()
    assert "/follow: it has gone" in party.next(op="action_result")["values"]


@pytest.fixture
def offer(party: Party, node: Node) -> Callable[[], Any]:
    """A function that lets a node send a goal to the action of the client, and returns the sent goal."""
    client = ActionClient(node, FJT, "/swing")
    # The client of an earlier test may still be leaving, and a goal to its action would be lost.
    wait_for(lambda: not client.server_is_ready(), "the action of an earlier test is seen no more")
    party.ask(op="advertise_action", action="swing", type=KIND)
    assert client.wait_for_server(30)

    class Sent:
        def __init__(self) -> None:
            self.feedback: list[Any] = []
            goal = FJT.Goal()
            goal.trajectory.joint_names = ["a"]
            accepted = client.send_goal_async(goal, feedback_callback=self.feedback.append)
            self.handle = wait_for(accepted.done) and accepted.result()
            self.ended = self.handle.get_result_async()
            self.asked = party.next(op="send_action_goal")
            self.answer = {"id": self.asked["id"], "action": "swing"}

        @property
        def end(self) -> tuple[int, str]:
            wait_for(self.ended.done)
            return self.ended.result().status, self.ended.result().result.error_string

    return Sent


def test_goals_of_an_offered_action_end_with_the_status_of_the_client(party: Party, offer: Callable[[], Any]) -> None:
    failed = offer()
    party.ask(op="action_result", **failed.answer, result=False)
    assert failed.end == (ABORTED, "")
    aborted = offer()
    party.ask(op="action_status", **aborted.answer, status=2)
    party.ask(op="action_status", **aborted.answer, status=ABORTED)
    assert aborted.end == (ABORTED, "")
    cancelled = offer()
    cancelled.handle.cancel_goal_async()
    assert party.next(op="cancel_action_goal")["id"] == cancelled.asked["id"]
    party.ask(op="action_result", **cancelled.answer, values={}, status=CANCELED, result=True)
    assert cancelled.end == (CANCELED, "")


def test_goals_are_aborted_when_the_action_is_withdrawn_and_when_the_client_leaves(
    bridge: Bridge, party: Party, node: Node, offer: Callable[[], Any]
) -> None:
    sent = offer()
    party.ask(op="unadvertise_action", action="swing")
    assert sent.end == (ABORTED, "")
    # On DDS, the names also include services that have only clients.
    wait_for(lambda: "/swing" not in party.call("rosapi/action_servers")["action_servers"])
