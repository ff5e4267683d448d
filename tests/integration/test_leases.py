"""A leased trial belongs to its coordinator: nobody else can change what it is simulated with."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from tests.integration.robot import ARM, CONFIG, ELBOW, HEAD, PAUSED, STEP_NS, Robot, goal, signer, swing, trajectory
from throwcollect.episode.episode_message import unpack
from throwcollect.plan.lease import Lease, leases_to_json
from throwcollect.ros import DurabilityPolicy, QoSProfile, get_message
from throwcollect.run_key import Signer

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The profile of ros2_controllers; DDS connects only equally durable endpoints."""
LEASED = "the simulation is leased for trial 4, until its episode is handed over"
SpeedScalingFactor: Any = get_message("control_msgs/msg/SpeedScalingFactor")
Result: Any = get_message("simulation_interfaces/msg/Result")
SimulationState: Any = get_message("simulation_interfaces/msg/SimulationState")


def lease(robot: Robot, values: dict[str, float], *, by: Signer | None = None, trial: int = 4) -> Lease:
    return Lease.make(f"/{robot.name}", trial, values, by or signer())


def ask_for(robot: Robot, *leases: Lease) -> Any:
    return robot.set({"trial.leases": leases_to_json(leases)})


SLOWLY = {"sim.real_time_factor": 1.0}


@pytest.fixture
def leased(robot: Robot) -> Iterator[Robot]:
    """A simulation that is at a leased trial for more than a second."""
    assert robot.set(SLOWLY).successful
    assert ask_for(robot, lease(robot, {"ball.mass_kg": 0.05})).successful
    yield robot
    assert ask_for(robot).successful
    robot.set({"sim.real_time_factor": 0.0})


def wait_for_episodes(robot: Robot, *leases: Lease, meanwhile: Callable[[], object] = lambda: None) -> list[Any]:
    """What a simulation hands over of these leases."""
    with robot.listening("std_msgs/msg/UInt8MultiArray", "episode", raw=True) as heard:
        assert ask_for(robot, *leases).successful
        meanwhile()
        robot.wait_until(lambda: len(heard) == len(leases), "all episodes")
    return [unpack(message, signer()) for message in heard]


def test_leased_trials_are_simulated_and_judged_in_their_order(robot: Robot) -> None:
    leases = [lease(robot, {"ball.mass_kg": 0.04 + trial / 1000}, trial=trial) for trial in (4, 2, 3)]
    deliveries = wait_for_episodes(robot, *leases)
    assert [delivery.header.trial for delivery in deliveries] == [4, 2, 3]
    assert [json.loads(delivery.conditions.split("\n")[2]) for delivery in deliveries] == [
        dict(each.values) for each in leases
    ]
    assert [json.loads(delivery.result)["outcome"] for delivery in deliveries] == ["landed"] * 3
    start_ns = [delivery.header.start_ns for delivery in deliveries]
    assert start_ns == [CONFIG.trial_start_ns(trial) for trial in (4, 2, 3)]


def test_steps_of_a_paused_simulation_go_on_beyond_the_end_of_a_trial(robot: Robot) -> None:
    robot.put_into(PAUSED)

    def step() -> None:
        start_ns = robot.now_ns()
        assert start_ns == CONFIG.trial_start_ns(4)
        assert robot.step(2000).result == Result.RESULT_OK
        assert robot.now_ns() - start_ns == 2000 * STEP_NS

    (delivery,) = wait_for_episodes(robot, lease(robot, {}), meanwhile=step)
    assert delivery.header.trial == 4


def test_leases_that_are_not_signed_are_refused(robot: Robot) -> None:
    for wrong in (lease(robot, {}, by=Signer(b"another key")), replace(lease(robot, {}), simulation="/sim_9")):
        result = ask_for(robot, wrong)
        assert not result.successful
        assert result.reason == f"trial.leases: is not signed for /{robot.name} with the key of this run"
    assert not robot.set({"trial.leases": "trial 5, please"}).successful
    assert robot.now_ns() == 0


def test_leases_cannot_be_set_together_with_other_parameters(robot: Robot) -> None:
    result = robot.set({"trial.leases": "[]", "ball.mass_kg": 0.05})
    assert not result.successful
    assert result.reason == "trial.leases: is set alone, not with ball.mass_kg"


def test_a_leased_trial_ignores_parameters_that_were_set_by_hand(robot: Robot) -> None:
    by_hand = {"ball.friction": 0.1, "scene.gravity_mps2": 1.6}
    assert robot.set(by_hand).successful
    assert robot.set({"constraints.goal_time": 0.1, "cmd_timeout": 0.2}, node=ARM).successful
    (delivery,) = wait_for_episodes(robot, lease(robot, {"ball.mass_kg": 0.05}))
    assert '{"ball.mass_kg": 0.05}' in delivery.conditions.split("\n")
    physics = robot.parameters("get_parameters", names=list(by_hand)).values
    assert [value.double_value for value in physics] == [CONFIG.ball.friction, CONFIG.scene.gravity_mps2]
    limits = robot.parameters("get_parameters", node=ARM, names=["constraints.goal_time", "cmd_timeout"]).values
    assert [value.double_value for value in limits] == [0.6, 0.0]


@pytest.mark.parametrize(("factor", "accepted"), [(0.0, True), (1.0, True), (5.0, True), (0.99, False), (0.001, False)])
def test_a_leased_trial_is_slowed_down_to_real_time_and_no_further(
    factor: float, accepted: bool, leased: Robot
) -> None:
    result = leased.set({"sim.real_time_factor": factor})
    assert result.successful == accepted
    if not accepted:
        expected = f"should be 1 or more, or 0 for no limit, as {LEASED}, got {factor:g}"
        assert result.reason == f"sim.real_time_factor: {expected}"


def test_slow_motion_ends_when_a_trial_is_leased(robot: Robot) -> None:
    assert robot.set({"sim.real_time_factor": 0.01}).successful
    wait_for_episodes(robot, lease(robot, {}))
    (value,) = robot.parameters("get_parameters", names=["sim.real_time_factor"]).values
    assert value.double_value == 0.0


def test_parameters_of_a_leased_trial_cannot_be_set(leased: Robot) -> None:
    result = leased.set({"ball.friction": 0.1})
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
    ],
)
def test_the_world_of_a_leased_trial_cannot_be_changed(service: str, fields: dict[str, Any], leased: Robot) -> None:
    result = leased.call(service, **fields).result
    assert (result.result, result.error_message) == (Result.RESULT_INCORRECT_STATE, LEASED)


def test_other_clients_cannot_move_or_stop_a_leased_controller(robot: Robot) -> None:
    asked = [lease(robot, {"ball.mass_kg": 0.05}) for _ in range(2)]
    (untouched,) = wait_for_episodes(robot, asked[0])
    assert robot.set(SLOWLY).successful

    def disturb() -> None:
        assert not robot.send(swing()).accepted
        assert not robot.send(goal(HEAD), HEAD).accepted
        robot.publish(f"{ARM}/joint_trajectory", trajectory(ARM, 0.5))
        robot.publish(f"{ARM}/speed_scaling_input", SpeedScalingFactor(factor=0.5), LATCHED)

    (touched,) = wait_for_episodes(robot, asked[1], meanwhile=disturb)
    robot.set({"sim.real_time_factor": 0.0})
    assert touched.digest == untouched.digest


def test_controllers_are_as_configured_in_every_leased_trial(robot: Robot) -> None:
    (untouched,) = wait_for_episodes(robot, lease(robot, {}))
    assert robot.set({f"constraints.{ELBOW}.trajectory": 1e-12}, node=ARM).successful
    robot.publish(f"{ARM}/speed_scaling_input", SpeedScalingFactor(factor=0.5), LATCHED)
    (touched,) = wait_for_episodes(robot, lease(robot, {}))
    assert touched.digest == untouched.digest
