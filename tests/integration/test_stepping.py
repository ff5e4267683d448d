"""Stepping through a paused simulation, by the service and by the action of simulation_interfaces."""

from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    ELBOW,
    PATIENCE_S,
    PAUSED,
    STEP_NS,
    Result,
    Robot,
    goal,
    in_order_of_arrival,
    stamp_ns,
)
from throwcollect.ros import ActionClient, get_action

SimulateSteps: Any = get_action("simulation_interfaces/action/SimulateSteps")
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
FOR_EVER = 2**40
"""Steps that would take months."""


@pytest.fixture(scope="module")
def action(shared: Robot) -> ActionClient:
    client = ActionClient(shared.node, SimulateSteps, shared.topic("simulate_steps"))
    assert client.wait_for_server(PATIENCE_S)
    return client


def begin(robot: Robot, action: ActionClient, steps: int, **options: Any) -> Any:
    handle = robot.result(action.send_goal_async(SimulateSteps.Goal(steps=steps), **options))
    assert handle.accepted
    return handle


def end(robot: Robot, handle: Any) -> tuple[int, int, str]:
    response = robot.result(handle.get_result_async())
    result = response.result.result
    return int(response.status), int(result.result), str(result.error_message)


@pytest.mark.parametrize("steps", [1, 7, 500])
def test_steps_advance_the_clock_exactly(steps: int, robot: Robot) -> None:
    robot.put_into(PAUSED)
    assert robot.step(steps).result == Result.RESULT_OK
    assert robot.now_ns() == steps * STEP_NS
    assert robot.step(3).result == Result.RESULT_OK
    assert robot.now_ns() == (steps + 3) * STEP_NS
    assert robot.state() == PAUSED


def test_steps_carry_a_goal_forward(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handle = robot.send(goal(ARM, 1.0, arm_right_4_joint=-0.5))
    before = robot.joint(ELBOW)
    robot.step(250)
    assert robot.joint(ELBOW) == pytest.approx((before - 0.5) / 2, abs=0.01)
    robot.step(260)
    assert robot.outcome(handle)[1] == 0


@pytest.mark.parametrize("steps", [1, 10])
def test_the_clock_shows_steps_to_the_nanosecond(steps: int, robot: Robot) -> None:
    robot.put_into(PAUSED)
    robot.step(3)
    with robot.listening("rosgraph_msgs/msg/Clock", "clock") as heard:
        robot.wait_until(lambda: bool(heard), "the time so far")
        robot.step(steps)
        robot.wait_until(lambda: stamp_ns(heard[-1].clock) >= (3 + steps) * STEP_NS, "the time after the steps")
    stamps = [stamp_ns(message.clock) for message in heard]
    assert stamps[-1] == (3 + steps) * STEP_NS
    assert stamps == sorted(set(stamps))


@in_order_of_arrival
def test_the_step_action_gives_feedback_on_each_step_and_ends_paused(robot: Robot, action: ActionClient) -> None:
    robot.put_into(PAUSED)
    told: list[tuple[int, int]] = []

    def take(message: Any) -> None:
        told.append((int(message.feedback.completed_steps), int(message.feedback.remaining_steps)))

    # A goal of zero steps comes first, so that the simulation knows of the subscription before the real goal.
    end(robot, begin(robot, action, 0, feedback_callback=take))
    robot.state()
    handle = begin(robot, action, 60, feedback_callback=take)
    assert end(robot, handle) == (SUCCEEDED, Result.RESULT_OK, "")
    robot.wait_until(lambda: bool(told) and told[-1] == (60, 0), "the last feedback")
    # The queue of a client keeps only the last ten messages.
    assert len(told) >= 10
    assert told == [(step, 60 - step) for step, _ in sorted(told)]
    assert robot.now_ns() == 60 * STEP_NS
    assert robot.state() == PAUSED


def test_other_step_requests_are_refused_while_steps_are_taken(robot: Robot, action: ActionClient) -> None:
    robot.put_into(PAUSED)
    handle = begin(robot, action, FOR_EVER)
    robot.wait_until(lambda: robot.now_ns() > 0, "steps are taken")
    refused = robot.step(1)
    assert refused.result == Result.RESULT_INCORRECT_STATE
    assert f"of {FOR_EVER} steps of another request" in refused.error_message
    status, code, _ = end(robot, begin(robot, action, 1))
    assert (status, code) == (ABORTED, Result.RESULT_INCORRECT_STATE)
    assert robot.result(handle.cancel_goal_async()).return_code == 0
    status, code, words = end(robot, handle)
    assert (status, code) == (CANCELED, Result.RESULT_OPERATION_FAILED)
    assert words.startswith("cancelled, after ")
    assert words.endswith(f" of {FOR_EVER} steps")
    assert int(words.split()[2]) * STEP_NS == robot.now_ns()
    assert robot.step(1).result == Result.RESULT_OK
