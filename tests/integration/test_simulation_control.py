"""The services of simulation_interfaces."""

from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    CONFIG,
    ELBOW,
    PAUSED,
    PLAYING,
    POSTURE,
    STEP_NS,
    STOPPED,
    Result,
    Robot,
    goal,
    swing,
)
from throwcollect.interfaces import get_message, get_service

SetState: Any = get_service("simulation_interfaces/srv/SetSimulationState")
SetEntityState: Any = get_service("simulation_interfaces/srv/SetEntityState")
Reset: Any = get_service("simulation_interfaces/srv/ResetSimulation").Request
Features: Any = get_message("simulation_interfaces/msg/SimulatorFeatures")
EntityState: Any = get_message("simulation_interfaces/msg/EntityState")


def entity_state(*, z: float = 1.0, vx: float = 0.0, w: float = 1.0, frame: str = "world") -> Any:
    state = EntityState()
    state.header.frame_id = frame
    state.pose.position.x, state.pose.position.z = 2.0, z
    state.pose.orientation.w = w
    state.twist.linear.x = vx
    return state


def test_the_listed_features_are_those_that_work(robot: Robot) -> None:
    features = robot.call("get_simulator_features").features
    assert sorted(features.features) == sorted(
        [
            Features.ENTITY_STATE_GETTING,
            Features.ENTITY_STATE_SETTING,
            Features.SIMULATION_RESET,
            Features.SIMULATION_STATE_GETTING,
            Features.SIMULATION_STATE_SETTING,
            Features.SIMULATION_STATE_PAUSE,
            Features.STEP_SIMULATION_SINGLE,
            Features.STEP_SIMULATION_MULTIPLE,
        ]
    )
    assert list(features.spawn_formats) == []
    assert "one step is one physics step of 0.002 s" in features.custom_info


def test_a_simulation_plays_from_the_start(robot: Robot) -> None:
    response = robot.call("get_simulation_state")
    assert (response.state.state, response.result.result) == (PLAYING, Result.RESULT_OK)


def test_states_change_and_the_present_one_is_refused(robot: Robot) -> None:
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


def test_stopping_resets_and_nothing_runs_until_it_plays_again(robot: Robot) -> None:
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
    start = robot.call("get_entity_state", entity="ball").state
    robot.outcome(robot.send(swing()))
    assert robot.call("get_entity_state", entity="ball").state.pose.position.z < 0.1
    assert robot.call("reset_simulation", scope=scope).result.result == Result.RESULT_OK
    assert robot.call("get_entity_state", entity="ball").state == start
    assert robot.joint(ELBOW) == pytest.approx(POSTURE[ELBOW], abs=1e-4)


@pytest.mark.parametrize("scope", [Reset.SCOPE_TIME, Reset.SCOPE_STATE, Reset.SCOPE_SPAWNED, 3])
def test_a_reset_of_parts_is_refused_and_changes_nothing(scope: int, robot: Robot) -> None:
    robot.put_into(PAUSED)
    robot.step(5)
    refused = robot.call("reset_simulation", scope=scope).result
    assert refused.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert refused.error_message == f"scope {scope}: only DEFAULT and ALL are supported"
    assert robot.now_ns() == 5 * STEP_NS


def test_a_start_state_that_does_not_exist_is_refused_and_another_one_can_be_set(robot: Robot) -> None:
    assert robot.set({"ball.radius_m": 0.005}).successful
    refused = robot.call("reset_simulation").result
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert "must be above tool.cup_floor_radius_m = 0.006" in refused.error_message
    assert robot.put_into(STOPPED).result == SetState.Response.STATE_TRANSITION_ERROR
    robot.put_into(PLAYING)
    assert robot.set({"ball.radius_m": CONFIG.ball.radius_m}).successful
    robot.reset()
    assert robot.outcome(robot.send(swing()))[1] == 0


@pytest.mark.parametrize("steps", [1, 7, 500])
def test_steps_advance_the_clock_exactly(steps: int, robot: Robot) -> None:
    robot.put_into(PAUSED)
    assert robot.step(steps).result == Result.RESULT_OK
    assert robot.now_ns() == steps * STEP_NS
    assert robot.step(3).result == Result.RESULT_OK
    assert robot.now_ns() == (steps + 3) * STEP_NS
    assert robot.state() == PAUSED


@pytest.mark.parametrize("state", [PLAYING, STOPPED])
def test_steps_are_refused_unless_it_is_paused(state: int, robot: Robot) -> None:
    if state != PLAYING:
        robot.put_into(state)
    refused = robot.step(1)
    assert refused.result == Result.RESULT_INCORRECT_STATE
    assert "paused" in refused.error_message
    assert robot.now_ns() == 0


def test_more_steps_than_a_caller_would_wait_for_are_refused(robot: Robot) -> None:
    robot.put_into(PAUSED)
    refused = robot.step(2**40)
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert "at most" in refused.error_message
    assert robot.now_ns() == 0


def test_steps_carry_a_goal_forward(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handle = robot.send(goal(ARM, 1.0, arm_right_4_joint=-0.5))
    before = robot.joint(ELBOW)
    robot.step(250)
    assert robot.joint(ELBOW) == pytest.approx((before - 0.5) / 2, abs=0.01)
    robot.step(260)
    assert robot.outcome(handle)[1] == 0


def test_an_unknown_entity_is_named_with_those_that_are_known(robot: Robot) -> None:
    for result in (
        robot.call("get_entity_state", entity="table").result,
        robot.call("set_entity_state", entity="table", state=entity_state()).result,
    ):
        assert result.result == Result.RESULT_NOT_FOUND
        assert result.error_message == "no entity 'table'; known: ball, talos"


def test_the_ball_lies_in_the_spoon_and_the_robot_stands_on_its_base(robot: Robot) -> None:
    ball = robot.call("get_entity_state", entity="ball").state
    assert ball.header.frame_id == "world"
    assert 0.5 < ball.pose.position.z < 2.0
    talos = robot.call("get_entity_state", entity="talos").state
    assert talos.pose.position.z == 1.01927
    assert talos.pose.orientation.w == 1.0


def test_a_ball_that_was_put_somewhere_flies_on_from_there(robot: Robot) -> None:
    robot.put_into(PAUSED)
    placed = robot.call("set_entity_state", entity="ball", state=entity_state(z=1.5, vx=1.0))
    assert placed.result.result == Result.RESULT_OK
    there = robot.call("get_entity_state", entity="ball").state
    assert (there.pose.position.x, there.pose.position.z, there.twist.linear.x) == (2.0, 1.5, 1.0)
    robot.step(100)
    flown = robot.call("get_entity_state", entity="ball").state
    assert flown.pose.position.x == pytest.approx(2.2, abs=1e-3)
    assert flown.pose.position.z == pytest.approx(1.5 - 9.81 * 0.2**2 / 2, abs=5e-3)
    assert flown.twist.linear.z == pytest.approx(-9.81 * 0.2, abs=1e-2)


@pytest.mark.parametrize(
    ("state", "code", "words"),
    [
        (entity_state(w=0.0), SetEntityState.Response.INVALID_POSE, "quaternion of norm 0"),
        (entity_state(w=0.9), SetEntityState.Response.INVALID_POSE, "quaternion of norm 0.9"),
        (entity_state(w=float("nan")), SetEntityState.Response.INVALID_POSE, "quaternion of norm nan"),
        (entity_state(z=float("nan")), SetEntityState.Response.INVALID_POSE, "nan"),
        (entity_state(z=1e9), SetEntityState.Response.INVALID_POSE, "wanted within 1000 m"),
        (entity_state(vx=float("inf")), Result.RESULT_OPERATION_FAILED, "inf"),
        (entity_state(frame="base_link"), Result.RESULT_OPERATION_FAILED, "frame base_link: only world is known"),
    ],
)
def test_a_state_without_meaning_is_refused_and_leaves_the_ball(
    state: Any, code: int, words: str, robot: Robot
) -> None:
    before = robot.call("get_entity_state", entity="ball").state
    refused = robot.call("set_entity_state", entity="ball", state=state).result
    assert refused.result == code
    assert words in refused.error_message
    assert robot.call("get_entity_state", entity="ball").state == before


def test_the_robot_is_fixed(robot: Robot) -> None:
    refused = robot.call("set_entity_state", entity="talos", state=entity_state()).result
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert refused.error_message == "talos is fixed to the world"
