"""A leased trial belongs to its coordinator: nobody else can change what it is simulated with."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.integration.robot import ARM, CONFIG, ELBOW, HEAD, POSTURE, TORSO, Robot, goal, signer, swing, trajectory
from throwcollect.episode.message import Delivery, unpack
from throwcollect.ros import DurabilityPolicy, QoSProfile, get_message
from throwcollect.run_key import Signer
from throwcollect.trial.lease import Lease

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As ros2_controllers have it; DDS connects no others."""
LEASED = "the simulation is leased for trial 4, until its episode is handed over"
SpeedScalingFactor: Any = get_message("control_msgs/msg/SpeedScalingFactor")
Result: Any = get_message("simulation_interfaces/msg/Result")
SimulationState: Any = get_message("simulation_interfaces/msg/SimulationState")


def ask_for(robot: Robot, values: dict[str, float], *, by: Signer | None = None, trial: int = 4) -> Any:
    lease = Lease(f"/{robot.name}", trial, (ARM, TORSO), values)
    parameters = {"trial.number": trial, "trial.controllers": [ARM, TORSO], "trial.lease": lease.sign(by or signer())}
    return robot.set({**parameters, **values})


@pytest.fixture
def leased(robot: Robot) -> Iterator[Robot]:
    assert ask_for(robot, {"ball.mass_kg": 0.05}).successful
    yield robot
    robot.set({"trial.number": -1})


def finished(robot: Robot) -> Delivery:
    with robot.listening("std_msgs/msg/UInt8MultiArray", "episode", raw=True) as heard:
        assert robot.send(swing()).accepted
        assert robot.send(goal(TORSO), TORSO).accepted
        robot.wait_until(lambda: bool(heard), "an episode")
    return unpack(heard[0], signer())


def test_a_lease_begins_its_trial_at_once(leased: Robot) -> None:
    assert leased.now_ns() == CONFIG.trial_start_ns(4)
    delivery = finished(leased)
    assert delivery.episode.header.trial == 4
    conditions = json.loads(delivery.conditions)
    assert conditions["values"] == {"ball.mass_kg": 0.05}
    assert sorted(conditions["inputs"]) == [ARM, TORSO]


@pytest.mark.parametrize("stranger", [Signer(b"another key")])
def test_a_lease_that_is_not_signed_is_refused(robot: Robot, stranger: Signer) -> None:
    result = ask_for(robot, {}, by=stranger)
    assert not result.successful
    assert result.reason == "trial.lease: is not signed with the key of this run"
    assert robot.now_ns() == 0


def test_what_a_lease_does_not_say_is_as_configured(robot: Robot) -> None:
    assert robot.set({"ball.friction": 0.1, "scene.gravity_mps2": 1.6}).successful
    assert ask_for(robot, {"ball.mass_kg": 0.05}).successful
    values = robot.parameters("get_parameters", names=["ball.friction", "scene.gravity_mps2", "ball.mass_kg"]).values
    shown = [value.double_value for value in values]
    assert shown == [CONFIG.ball.friction, CONFIG.scene.gravity_mps2, 0.05]
    assert json.loads(finished(robot).conditions)["values"] == {"ball.mass_kg": 0.05}


@pytest.mark.parametrize(
    "values", [{"ball.friction": 0.1}, {"trial.number": 5}, {"trial.number": -1, "ball.friction": 0.1}]
)
def test_parameters_of_a_leased_trial_cannot_be_set(values: dict[str, Any], leased: Robot) -> None:
    result = leased.set(values)
    assert not result.successful
    assert LEASED in result.reason


def test_controllers_of_a_leased_trial_cannot_be_set(leased: Robot) -> None:
    result = leased.set({"constraints.goal_time": 0.01}, node=ARM)
    assert not result.successful
    assert result.reason == LEASED


@pytest.mark.parametrize(
    ("service", "fields"),
    [
        ("reset_simulation", {}),
        ("set_simulation_state", {"state": SimulationState(state=0)}),
        ("set_entity_state", {"entity": "ball"}),
        ("delete_entity", {"entity": "ball"}),
        ("spawn_entity", {"name": "box"}),
        ("spawn_entities", {}),
    ],
)
def test_the_world_of_a_leased_trial_cannot_be_changed(service: str, fields: dict[str, Any], leased: Robot) -> None:
    result = leased.call(service, **fields).result
    assert (result.result, result.error_message) == (Result.RESULT_INCORRECT_STATE, LEASED)


def test_a_leased_trial_takes_one_goal_for_each_of_its_controllers(leased: Robot) -> None:
    assert not leased.send(goal(HEAD), HEAD).accepted
    assert leased.send(swing()).accepted
    assert not leased.send(swing(0.5)).accepted


def test_nothing_else_moves_or_stops_a_leased_controller(leased: Robot) -> None:
    with leased.listening("std_msgs/msg/UInt8MultiArray", "episode", raw=True) as heard:
        arm = leased.send(swing())
        leased.publish(f"{ARM}/joint_trajectory", trajectory(ARM, 0.5))
        leased.publish(f"{ARM}/speed_scaling_input", SpeedScalingFactor(factor=0.5), LATCHED)
        answer = leased.result(arm.cancel_goal_async())
        assert not answer.goals_canceling
        assert leased.send(goal(TORSO), TORSO).accepted
        leased.wait_until(lambda: bool(heard), "an episode")
    touched = unpack(heard[0], signer()).episode
    assert ask_for(leased, {"ball.mass_kg": 0.05}).successful
    untouched = finished(leased).episode
    assert touched.digest == untouched.digest


def test_controllers_are_as_configured_in_every_leased_trial(leased: Robot) -> None:
    untouched = finished(leased).episode
    assert leased.set({f"constraints.{ELBOW}.trajectory": 1e-12}, node=ARM).successful
    leased.publish(f"{ARM}/speed_scaling_input", SpeedScalingFactor(factor=0.5), LATCHED)
    assert ask_for(leased, {"ball.mass_kg": 0.05}).successful
    assert finished(leased).episode.digest == untouched.digest


def test_a_lease_can_be_ended_by_hand(leased: Robot) -> None:
    assert leased.set({"trial.number": -1}).successful
    assert leased.set({"ball.friction": 0.2}).successful
    leased.reset()
    assert leased.joint(ELBOW) == pytest.approx(POSTURE[ELBOW], abs=1e-4)


def test_what_was_simulated_without_a_lease_says_so(robot: Robot) -> None:
    assert robot.set({"trial.number": 4, "trial.controllers": [ARM, TORSO], "ball.mass_kg": 0.05}).successful
    robot.reset()
    assert json.loads(finished(robot).conditions)["lease"] == ""
