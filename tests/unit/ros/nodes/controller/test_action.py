"""Goals get feedback on their whole course, even if the action server makes their handles late."""

from types import SimpleNamespace
from typing import Any

import pytest
from tests.integration.robot import ARM, goal, stamp_ns

from rclzenoh.interfaces import deserialize, serialize
from throwcollect.config.schema import Config
from throwcollect.ros import GoalResponse
from throwcollect.ros.nodes.controller import action as controller_action
from throwcollect.ros.nodes.controller.action import ControllerAction, feedback_message, read_trajectory
from throwcollect.sim.live import LiveSimulator


class Server:
    """Holds the callbacks of an action server, to be called in any order."""

    def __init__(self, *_: Any, **callbacks: Any) -> None:
        self.consider, self.accept = callbacks["goal_callback"], callbacks["handle_accepted_callback"]


class Handle:
    def __init__(self, number: int) -> None:
        self.goal_id = SimpleNamespace(uuid=[number] * 16)
        self.told: list[int] = []

    def publish_feedback(self, feedback: Any) -> None:
        self.told.append(stamp_ns(feedback.header.stamp) // 1_000_000)

    def execute(self) -> None:
        pass


@pytest.fixture
def simulation() -> Any:
    simulation = LiveSimulator(Config())
    yield simulation
    simulation.close()


@pytest.fixture
def action(simulation: LiveSimulator, monkeypatch: pytest.MonkeyPatch) -> ControllerAction:
    monkeypatch.setattr(controller_action, "ActionServer", Server)
    node: Any = SimpleNamespace(get_name=lambda: ARM, count_subscribers=lambda _topic: 1)
    return ControllerAction(node, simulation, ARM, aborts_refused=False)


def advance(simulation: LiveSimulator, action: ControllerAction) -> None:
    """Advance by a stretch of 50 ms, and send the feedback that follows."""
    assert action.watched
    simulation.advance(watched=True)
    for _, result in simulation.pop_results():
        action.finish(result)
    if action.owes_feedback:
        action.publish_feedback(simulation.observe(ARM).state(simulation.now_ns))


@pytest.mark.parametrize("stretches_before", [0, 1, 3])
def test_a_goal_with_a_late_handle_gets_all_its_feedback(
    stretches_before: int, simulation: LiveSimulator, action: ControllerAction
) -> None:
    server: Any = action._server
    assert server.consider(goal(ARM, 1.0, arm_right_4_joint=-1.7)) is GoalResponse.ACCEPT
    handle = Handle(1)
    for number in range(5):
        if number == stretches_before:
            server.accept(handle)
        advance(simulation, action)
    assert handle.told == [50, 100, 150, 200, 250]


def test_a_goal_that_ended_before_its_handle_gets_only_its_own_feedback(
    simulation: LiveSimulator, action: ControllerAction
) -> None:
    server: Any = action._server
    server.consider(goal(ARM, 1.0, arm_right_4_joint=-1.7))
    advance(simulation, action)
    server.consider(goal(ARM, 1.0, arm_right_4_joint=-1.5))
    advance(simulation, action)
    first, second = Handle(1), Handle(2)
    server.accept(first)
    server.accept(second)
    advance(simulation, action)
    # The first goal ends with the update after the second came, and a stretch of time with a goal.
    assert (first.told, second.told) == ([50], [52, 102])


def test_the_result_of_a_leased_goal_is_not_that_of_a_client(
    simulation: LiveSimulator, action: ControllerAction
) -> None:
    server: Any = action._server
    server.consider(goal(ARM, 1.0, arm_right_4_joint=-1.7))
    simulation.begin(1, {})
    for _ in range(10):
        for _, result in simulation.pop_results():
            action.finish(result)
        simulation.advance(watched=True)
    simulation.drop()
    assert action._goals[1].result.result().error_string == "simulation was reset"


def test_feedback_on_a_trajectory_stamped_decades_ago_can_be_serialized(simulation: LiveSimulator) -> None:
    message = goal(ARM, 1.0).trajectory
    message.header.stamp.sec = -(2**31) + 1
    message.points = message.points[-1:]
    message.points[0].time_from_start.sec = 2**31 - 1
    message.points[0].time_from_start.nanosec = 2 * 10**9
    assert simulation.follow(ARM, read_trajectory(message)) is None
    simulation.step(700)
    feedback = feedback_message(simulation.observe(ARM).state(simulation.now_ns))
    assert feedback.actual.time_from_start.sec == feedback.desired.time_from_start.sec == 2**31 - 1
    assert deserialize(serialize(feedback), type(feedback)) == feedback
