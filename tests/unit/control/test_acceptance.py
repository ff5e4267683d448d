"""Acceptance cases, taken from ros2_controllers' joint trajectory controller, beyond the course of a single goal."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.values import ErrorCode, GoalStatus

from .bench import (
    JOINTS,
    MOVING_END,
    PARTIAL,
    PREEMPTED,
    REACHED,
    SHIPPED,
    TALOS,
    Bench,
    Plant,
    braking,
    constrain,
    goal,
    point,
    seconds,
    to,
)


def test_texts_of_broken_tolerances_name_joint_error_and_tolerance() -> None:
    off_path = Bench(constrain(trajectory=0.105), Plant("frozen"))
    off_path.send(goal(to(1.0, 2.1)))
    off_path.step(20)
    assert off_path.results[0][1].error_string == (
        "Aborted due to path tolerance violation: joint j1 has position error 0.11 rad, tolerance 0.105 rad"
    )
    late = Bench(TALOS, Plant("frozen"))
    late.send(goal(to(0.5, 1.6)))
    late.step(120)
    assert late.results[0][1].error_string == (
        "Aborted due to goal_time_tolerance exceeding by 0.610000 seconds: "
        "joint j1 has position error 0.5 rad, tolerance 0.02 rad"
    )


def test_the_desired_position_is_one_step_behind_the_command() -> None:
    bench = Bench()
    bench.send(goal(to(1.0, 2.1)))
    desired = []
    for _ in range(102):
        bench.step()
        desired.append(bench.controller.state().desired.positions[0])
    assert np.array(desired)[[0, 49, 98, 99, 100]] == pytest.approx([1.10, 1.59, 2.08, 2.09, 2.10], abs=1e-6)


def test_a_new_goal_preempts_the_old_one_and_starts_from_the_measured_state() -> None:
    bench = Bench()
    bench.send(goal(to(2.0, 4.0)), "A")
    bench.step(20)
    assert bench.commands[20][0] == pytest.approx(1.39)
    bench.send(goal(to(0.1, 1.0)), "B")
    (_, first), *others = bench.results
    assert (first.goal_id, first.status, first.error_code, first.error_string) == ("A", *PREEMPTED)
    assert others == []
    bench.step(20)
    assert bench.commands[1][0] == pytest.approx(1.351, abs=1e-6)
    k, second = bench.results[1]
    assert (second.goal_id, second.status, second.error_string, k) == ("B", REACHED[0], REACHED[2], 10)


def test_the_result_of_a_goal_is_kept_when_the_next_goal_begins() -> None:
    bench = Bench()
    bench.controller.submit("A", goal(to(0.0, 2.1)), bench.now_ns)
    bench.controller.update(bench.now_ns + 1, bench.plant.measure())
    bench.controller.submit("B", goal(to(1.0, 2.1)), bench.now_ns)
    assert [(result.goal_id, result.status) for result in bench.controller.pop_results()] == [("A", REACHED[0])]


def test_parameters_changed_during_a_goal_apply_to_the_next_goal() -> None:
    bench = Bench(TALOS, Plant("frozen"))
    bench.send(goal(to(0.5, 1.6)), "A")
    bench.step(10)
    bench.controller.parameters = constrain(goal=9.0, goal_time=0.6)
    bench.step(120)
    bench.send(goal(to(0.5, 1.6)), "B")
    bench.step(120)
    assert [result.status for _, result in bench.results] == [GoalStatus.ABORTED, GoalStatus.SUCCEEDED]


def test_a_trajectory_from_the_topic_is_followed_without_a_goal() -> None:
    bench = Bench()
    assert bench.controller.replace(goal(to(0.2, 1.3)).trajectory, bench.now_ns) is None
    bench.step(30)
    assert bench.plant.position[0] == pytest.approx(1.3)
    assert bench.results == []
    assert bench.controller.goal_id is None


def test_a_trajectory_from_the_topic_does_not_keep_tolerances_of_an_ended_goal() -> None:
    bench = Bench(plant=Plant("frozen"))
    bench.send(goal(to(1.0, 1.2), path_tolerance=("j1", 0.05)))
    bench.step(60)
    assert bench.results[0][1].error_code == ErrorCode.PATH_TOLERANCE_VIOLATED
    bench.controller.replace(goal(to(1.0, 2.1)).trajectory, bench.now_ns)
    bench.step(120)
    assert bench.commands[bench.k][0] == pytest.approx(2.1)


def test_an_open_goal_keeps_its_tolerances_on_a_trajectory_from_the_topic() -> None:
    bench = Bench(plant=Plant("frozen"))
    bench.send(goal(to(1.0, 1.2), path_tolerance=("j1", 0.05)))
    bench.controller.replace(goal(to(1.0, 2.1)).trajectory, bench.now_ns)
    bench.step(20)
    assert bench.results[0][1].error_code == ErrorCode.PATH_TOLERANCE_VIOLATED


def test_a_trajectory_from_the_topic_that_breaks_a_tolerance_ends_in_a_hold() -> None:
    bench = Bench(TALOS, Plant("frozen"))
    bench.controller.replace(goal(to(0.5, 1.6)).trajectory, bench.now_ns)
    bench.step(110)
    assert bench.commands[110][0] == pytest.approx(1.6)
    bench.step(10)
    assert bench.commands[120][0] == pytest.approx(1.1)
    assert bench.results == []


@pytest.mark.parametrize(("parameters", "velocities"), [(braking(10.0), 3), (TALOS, 0)])
def test_the_controller_state_has_the_fields_of_the_state_interfaces(
    parameters: ControllerParameters, velocities: int
) -> None:
    bench = Bench(parameters, Plant("lag"))
    bench.send(goal(point(1.0, (2, 3, 1)), names=["j2", "j3", "j1"]))
    bench.step(30)
    state = bench.controller.state()
    assert state.joint_names == JOINTS
    assert {len(field) for field in dataclasses.astuple(state.desired)[1:]} == {3}
    assert (len(state.actual.velocities), len(state.error.velocities)) == (velocities, velocities)
    assert len(state.actual.accelerations) == 0
    assert state.error.positions == pytest.approx(state.desired.positions - state.actual.positions)
    assert np.abs(state.error.positions).max() > 0.005


def test_the_controller_state_has_reference_feedback_output_and_times() -> None:
    bench = Bench()
    bench.step(10)
    bench.send(goal(to(1.0, 2.1)))
    bench.step(50)
    state = bench.controller.state()
    assert state.stamp_ns == seconds(1000.60)
    assert state.desired.positions[0] == pytest.approx(1.59)
    assert state.desired.velocities[0] == pytest.approx(1.0)
    assert state.actual.positions[0] == pytest.approx(1.59)
    assert state.output.positions[0] == pytest.approx(1.60)
    assert (state.desired.time_from_start_ns, state.actual.time_from_start_ns) == (seconds(0.49), seconds(0.49))


def test_a_query_succeeds_from_the_first_update_to_the_end_of_the_trajectory() -> None:
    bench = Bench()
    bench.step(10)
    bench.send(goal(to(1.0, 2.1), to(2.0, 3.1)))
    bench.step(5)
    answers = {time: bench.controller.query(seconds(time)) for time in (1000.0, 1000.11, 1000.20, 1002.05, 1003.0)}
    assert [answer.success for answer in answers.values()] == [False, True, True, True, False]
    assert [answers[time].positions[0] for time in (1000.20, 1002.05, 1003.0)] == pytest.approx([1.19, 3.04, 3.1])


def test_a_reset_aborts_the_goal_and_holds_the_pose_measured_after_it() -> None:
    bench = Bench()
    bench.send(goal(to(1.0, 2.1)))
    bench.step(50)
    bench.plant.position = np.array((0.5, 0.6, 0.7))
    bench.now_ns = 0
    bench.controller.reset(0, bench.plant.measure())
    bench.collect()
    ((_, result),) = bench.results
    assert (result.status, result.error_code) == (GoalStatus.ABORTED, ErrorCode.INVALID_GOAL)
    assert result.error_string == "simulation was reset"
    bench.step(20)
    assert bench.commands[bench.k] == pytest.approx([0.5, 0.6, 0.7])
    bench.send(goal(to(1.0, 2.5)))
    bench.step(1)
    assert bench.commands[1][0] == pytest.approx(0.52)


def test_a_partial_goal_holds_the_other_joints_at_their_last_command() -> None:
    bench = Bench(PARTIAL, Plant("lag"))
    bench.send(goal(point(1.0, (1.1, 2.1, 4.1))))
    bench.step(50)
    bench.send(goal(point(0.2, (1.0,)), names=["j1"]), "B")
    bench.step(20)
    assert bench.commands[20] == pytest.approx([1.0, 2.1, 3.6])


def test_a_last_point_with_a_velocity_is_held_after_success() -> None:
    bench = Bench(MOVING_END)
    bench.send(goal(point(1.0, (2.1, 2.1, 3.1), (1.0, 0, 0))))
    bench.step(150)
    assert bench.commands[150][0] == pytest.approx(2.1)
    assert bench.controller.state().desired.velocities[0] == pytest.approx(1.0)


def test_a_goal_survives_a_clock_that_jumps_back() -> None:
    bench = Bench()
    bench.send(goal(to(1.0, 2.1)))
    bench.step(50)
    bench.now_ns -= seconds(0.9)
    bench.step(50)
    assert bench.commands[51][0] == pytest.approx(1.61)
    state = bench.controller.state()
    assert (state.desired.time_from_start_ns, state.actual.time_from_start_ns) == (seconds(0.99), seconds(0.09))
    assert bench.results[0][0] == 100


def test_joints_brake_each_from_its_own_speed_after_a_cancel() -> None:
    bench = Bench(braking(10.0), Plant("frozen", velocity=(0.2, -0.1, 0.0)))
    bench.send(goal(to(1.0, 2.1)))
    bench.step(1)
    bench.controller.cancel("A")
    bench.step(30)
    assert bench.commands[31] == pytest.approx([1.102, 2.0995, 3.1], abs=1e-6)
    assert bench.controller.state().desired.velocities.tolist() == [0, 0, 0]


def test_a_command_timeout_stops_a_trajectory_from_the_topic() -> None:
    bench = Bench(dataclasses.replace(SHIPPED, cmd_timeout=0.1), Plant("offset"))
    bench.controller.replace(goal(to(0.25, 1.2), to(0.5, 1.3), to(0.75, 1.4)).trajectory, bench.now_ns)
    bench.step(120)
    held = [k for k in range(1, 120) if bench.commands[k + 1][0] < bench.commands[k][0] - 0.2]
    assert held == [pytest.approx(86, abs=1)]
    assert bench.commands[120][0] == pytest.approx(1.1)
    assert bench.results == []


def test_a_command_timeout_that_is_not_above_the_goal_time_gives_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(dataclasses.replace(TALOS, cmd_timeout=0.6), Plant("offset"))
    assert "Command timeout must be higher than goal_time tolerance (0.6 vs. 0.6)" in caplog.text
    caplog.clear()
    bench.controller.parameters = dataclasses.replace(TALOS, cmd_timeout=0.61)
    assert caplog.text == ""


def test_negative_and_infinite_speed_factors_give_a_warning_and_change_nothing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    controller = Bench().controller
    controller.scale_speed(0.765)
    for factor in (-0.12, math.nan, math.inf, 1e300):
        controller.scale_speed(factor)
    assert controller.state().speed_scaling_factor == 0.765
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 4
    controller.scale_speed(0.0)
    assert controller.state().speed_scaling_factor == 0.0


def test_the_state_has_scaled_time_for_desired_and_real_time_for_actual() -> None:
    bench = Bench()
    bench.controller.scale_speed(0.5)
    bench.send(goal(to(1.0, 2.1)))
    bench.step(195)
    state = bench.controller.state()
    assert state.desired.time_from_start_ns == seconds(0.97)
    assert state.actual.time_from_start_ns == seconds(1.94)
    assert state.speed_scaling_factor == 0.5


def test_a_reset_restores_the_initial_speed() -> None:
    bench = Bench()
    bench.controller.scale_speed(0.25)
    bench.controller.reset(bench.now_ns, bench.plant.measure())
    assert bench.controller.state().speed_scaling_factor == 1.0
