"""The services of simulation_interfaces about features, states and resets."""

from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    ELBOW,
    PAUSED,
    PLAYING,
    POSTURE,
    STEP_NS,
    STOPPED,
    Result,
    Robot,
    goal,
    in_order_of_arrival,
    stamp_ns,
    swing,
)
from throwcollect.ros import get_message, get_service

SetState: Any = get_service("simulation_interfaces/srv/SetSimulationState")
Reset: Any = get_service("simulation_interfaces/srv/ResetSimulation").Request
Features: Any = get_message("simulation_interfaces/msg/SimulatorFeatures")
ABORTED, INVALID_GOAL = 6, -1


def test_get_simulator_features_lists_the_supported_features(robot: Robot) -> None:
    features = robot.call("get_simulator_features").features
    assert sorted(features.features) == sorted(
        [
            Features.ENTITY_STATE_GETTING,
            Features.ENTITY_STATE_SETTING,
            Features.SPAWNING,
            Features.SPAWNING_RESOURCE_STRING,
            Features.SPAWNABLES,
            Features.DELETING,
            Features.SIMULATION_RESET,
            Features.SIMULATION_RESET_SPAWNED,
            Features.SIMULATION_RESET_TIME,
            Features.SIMULATION_RESET_STATE,
            Features.SIMULATION_STATE_GETTING,
            Features.SIMULATION_STATE_SETTING,
            Features.SIMULATION_STATE_PAUSE,
            Features.STEP_SIMULATION_SINGLE,
            Features.STEP_SIMULATION_MULTIPLE,
            Features.STEP_SIMULATION_ACTION,
        ]
    )
    assert list(features.spawn_formats) == ["urdf"]
    assert "one step is one physics step of 0.002 s" in features.custom_info


def test_a_simulation_plays_from_the_start(robot: Robot) -> None:
    response = robot.call("get_simulation_state")
    assert (response.state.state, response.result.result) == (PLAYING, Result.RESULT_OK)


def test_each_state_can_be_set_and_the_present_one_is_refused(robot: Robot) -> None:
    for state, name in ((PAUSED, "PAUSED"), (PLAYING, "PLAYING"), (STOPPED, "STOPPED"), (PAUSED, "PAUSED")):
        assert robot.put_into(state).result == Result.RESULT_OK
        assert robot.state() == state
        again = robot.put_into(state)
        assert again.result == SetState.Response.ALREADY_IN_TARGET_STATE
        assert again.error_message == f"the simulation is {name} already"


@pytest.mark.parametrize("state", [4, 5, 77])
def test_states_that_cannot_be_set_are_refused(state: int, robot: Robot) -> None:
    refused = robot.put_into(state)
    assert refused.result == SetState.Response.INCORRECT_TRANSITION
    assert str(state) in refused.error_message
    assert robot.state() == PLAYING


def test_a_stopped_simulation_is_reset_and_holds_goals_until_it_plays(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handle = robot.send(swing())
    robot.step(100)
    assert robot.put_into(STOPPED).result == Result.RESULT_OK
    assert robot.outcome(handle)[2] == "simulation was reset"
    assert robot.now_ns() == 0
    held = robot.send(swing(0.3))
    assert held.accepted
    assert robot.now_ns() == 0
    robot.put_into(PLAYING)
    assert robot.outcome(held)[1] == 0


@pytest.mark.parametrize("scope", [Reset.SCOPE_DEFAULT, Reset.SCOPE_ALL])
def test_a_reset_brings_time_robot_and_ball_back(scope: int, robot: Robot) -> None:
    def ball() -> Any:
        return robot.call("get_entity_state", entity="ball").state

    start = ball()
    robot.outcome(robot.send(swing()))
    robot.wait_until(lambda: ball().pose.position.z < 0.1, "the ball falls")
    assert robot.call("reset_simulation", scope=scope).result.result == Result.RESULT_OK
    assert ball() == start
    assert robot.joint(ELBOW) == pytest.approx(POSTURE[ELBOW], abs=1e-4)


@in_order_of_arrival
def test_a_reset_of_time_aborts_goals_and_publishes_the_clock_while_paused(robot: Robot) -> None:
    robot.put_into(PAUSED)
    with robot.listening("rosgraph_msgs/msg/Clock", "clock") as heard:
        handle = robot.send(goal(ARM, 1.0, arm_right_4_joint=-0.5))
        robot.step(250)
        before = robot.joint(ELBOW)
        heard.clear()
        assert robot.call("reset_simulation", scope=Reset.SCOPE_TIME).result.result == Result.RESULT_OK
        robot.wait_until(lambda: bool(heard), "the time is told")
    assert [stamp_ns(message.clock) for message in heard] == [0]
    assert robot.state() == PAUSED
    assert robot.outcome(handle) == (ABORTED, INVALID_GOAL, "simulation was reset")
    assert robot.now_ns() == 0
    robot.step(100)
    assert robot.joint(ELBOW) == pytest.approx(before, abs=2e-3)
    assert before == pytest.approx((POSTURE[ELBOW] - 0.5) / 2, abs=0.01)
    assert robot.now_ns() == 100 * STEP_NS


def test_a_reset_of_states_goes_back_to_the_start_while_time_goes_on(robot: Robot) -> None:
    start = robot.call("get_entity_state", entity="ball").state
    assert robot.outcome(robot.send(goal(ARM, 1.0, arm_right_4_joint=-1.0)))[1] == 0
    robot.put_into(PAUSED)
    later = robot.now_ns()
    assert robot.call("reset_simulation", scope=Reset.SCOPE_STATE).result.result == Result.RESULT_OK
    assert robot.now_ns() == later > 0
    assert robot.call("get_entity_state", entity="ball").state.pose == start.pose
    # The joints stay at the start posture and do not return to where they were held before.
    robot.step(100)
    assert robot.joint(ELBOW) == pytest.approx(POSTURE[ELBOW], abs=1e-3)
    assert robot.now_ns() == later + 100 * STEP_NS
