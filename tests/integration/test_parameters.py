"""Trial and physics as ROS parameters."""

import re
from typing import Any

import pytest

from tests.integration.robot import ARM, CONFIG, ELBOW, PAUSED, POSTURE, STEP_NS, Robot, goal, swing
from throwcollect.config.key import Effect
from throwcollect.config.values import sweepable_keys

OWN = ["trial.leases", "sim.real_time_factor"]
FOREIGN = ("use_sim_time", "start_type_description_service")
"""Parameters that every node of ROS has."""
DOUBLE, STRING = 3, 4


def test_trial_clock_and_swept_physics_are_parameters(robot: Robot) -> None:
    physics = sweepable_keys(CONFIG, Effect.PHYSICS)
    assert "ball.mass_kg" in physics
    assert "task.start.arm_right_4_joint" in physics
    assert {"use_sim_time", *OWN, *physics} <= set(robot.parameters("list_parameters").result.names)


def test_parameters_have_types_and_the_values_of_the_configuration(robot: Robot) -> None:
    names = [*OWN, "ball.mass_kg"]
    described = robot.parameters("describe_parameters", names=names).descriptors
    assert [(each.name, each.type) for each in described] == list(zip(names, [STRING, DOUBLE, DOUBLE], strict=True))
    (mass,) = robot.parameters("get_parameters", names=["ball.mass_kg"]).values
    assert mass.double_value == CONFIG.ball.mass_kg


def range_of(descriptor: Any) -> tuple[float, float] | None:
    for span in (*descriptor.floating_point_range, *descriptor.integer_range):
        return span.from_value, span.to_value
    return None


def test_descriptions_of_parameters_come_from_the_configuration(robot: Robot) -> None:
    names = robot.parameters("list_parameters").result.names
    described = {each.name: each for each in robot.parameters("describe_parameters", names=names).descriptors}
    mine = {name: each for name, each in described.items() if name not in FOREIGN}
    assert [name for name, each in mine.items() if not each.description] == []
    mass = described["ball.mass_kg"]
    assert (mass.description, mass.additional_constraints) == ("Mass.", "number > 0, ≤ 2 kg")
    factor = described["sim.real_time_factor"]
    assert factor.additional_constraints == "a number from 0.001 to 1000, or 0 for no limit"
    angle = described["task.start.arm_right_4_joint"]
    assert angle.description.startswith("Joint angles at the start of each trial")
    spans = {
        "ball.mass_kg": (0.0, 2.0),
        "task.start.arm_right_4_joint": (-6.3, 6.3),
        "sim.real_time_factor": (0.0, 1000.0),
        "sim.physics_hz": (100, 10000),
        "record.trials_per_shard": (1, 2**63 - 1),
        "robot.name": None,
        "controllers.topic_aborts_goal": None,
    }
    assert {name: range_of(described[name]) for name in spans} == spans


@pytest.mark.parametrize("node", [None, ARM, "controller_manager"])
def test_nodes_of_a_simulation_take_no_time_from_others(robot: Robot, node: str | None) -> None:
    refused = robot.set({"use_sim_time": True}, node=node)
    assert (refused.successful, refused.reason) == (False, "use_sim_time: this node makes its time itself")
    # A dumped file of parameters says so.
    assert robot.set({"use_sim_time": False}, node=node).successful
    handle = robot.send(goal(ARM, 0.1))
    assert handle.accepted
    assert handle.stamp.sec < 1000


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"ball.mass_kg": 1}, "Wrong parameter type.*expected.*DOUBLE.*got.*INTEGER"),
        ({"ball.mass_kg": 0.0}, r"ball\.mass_kg: should be greater than 0, got 0\.0"),
    ],
)
def test_a_wrong_value_is_refused_with_the_reason(values: dict[str, Any], reason: str, robot: Robot) -> None:
    result = robot.set(values)
    assert not result.successful
    assert re.search(reason, result.reason)


def test_physics_takes_effect_with_the_next_reset(robot: Robot) -> None:
    start = {"task.start.arm_right_4_joint": -1.7, "scene.gravity_mps2": 1.6}
    assert robot.set(start).successful
    assert robot.joint(ELBOW) == pytest.approx(POSTURE[ELBOW], abs=1e-4)
    robot.reset()
    assert robot.joint(ELBOW) == pytest.approx(-1.7, abs=1e-4)


def test_a_real_time_factor_can_be_set_and_taken_back(robot: Robot) -> None:
    assert robot.set({"sim.real_time_factor": 5.0}).successful
    assert robot.outcome(robot.send(swing(0.3)))[1] == 0
    assert robot.set({"sim.real_time_factor": 0.0}).successful


def test_setting_parameters_does_not_move_the_clock(robot: Robot) -> None:
    robot.put_into(PAUSED)
    robot.step(3)
    assert robot.set({"ball.mass_kg": 0.05}).successful
    assert robot.now_ns() == 3 * STEP_NS


def test_the_rest_of_the_configuration_can_be_read_but_not_set(robot: Robot) -> None:
    names = ["sim.physics_hz", "task.trajectory.family", "task.duration_s"]
    values = robot.parameters("get_parameters", names=names).values
    assert (values[0].integer_value, values[1].string_value) == (CONFIG.sim.physics_hz, "minimum_jerk")
    assert values[2].double_value == CONFIG.task.duration_s
    result = robot.set({"task.duration_s": 2.0})
    assert not result.successful
    assert "read-only" in result.reason
