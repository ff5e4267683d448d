"""Goals are accepted, or refused with the same words, as by ros2_controllers' joint trajectory controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.values import ErrorCode, GoalStatus, TrajectoryGoal, TrajectoryRefusal

from .bench import (
    INTEGRATING,
    MOVING_END,
    ONE_POINT,
    PARTIAL,
    SHIPPED,
    START,
    ZERO,
    Bench,
    goal,
    last_velocity,
    point,
    to,
)


@dataclass(frozen=True)
class Answer:
    """A goal and the words of its refusal; none if it is accepted."""

    id: str
    goal: TrajectoryGoal
    refusal: Sequence[str] = ()
    parameters: ControllerParameters = SHIPPED


ANSWERS = [
    Answer("A1 one point", goal(*ONE_POINT)),
    Answer("A2 no names", goal(*ONE_POINT, names=[]), ["Joints on incoming trajectory don't match the controller"]),
    Answer("A2 no names, partial", goal(*ONE_POINT, names=[]), ["Empty joint names on incoming"], PARTIAL),
    Answer("A3 joint missing", goal(point(1.0, (1, 2)), names=["j1", "j2"]), ["don't match the controller", "j1, j2"]),
    Answer("A4 joint unknown", goal(*ONE_POINT, names=["j1", "j2", "x"]), ["Incoming joint x doesn't match", "j3"]),
    Answer("A5 no points", goal(), ["Empty trajectory received."]),
    Answer("A6 equal times", goal(to(0.25, 1), to(0.25, 2)), ["points 0 and 1 is not strictly increasing", "0.250000"]),
    Answer("A6 falling times", goal(to(0.5, 1), to(0.25, 2)), ["points 0 and 1", "0.500000 and 0.250000 respectively"]),
    Answer("A7 no positions", goal(point(1.0, ())), ["joint_names size (3) and positions (0) at point #0."]),
    Answer("A7 too few positions", goal(point(1.0, (1, 2))), ["and positions (2) at point #0."]),
    Answer("A7 too many positions", goal(point(1.0, (1, 2, 3, 4))), ["and positions (4) at point #0."]),
    Answer("A8 velocities", goal(point(1.0, START, (0, 0))), ["and velocities (2) at point #0."]),
    Answer("A8 accelerations", goal(point(1.0, START, (0, 0, 0), (0, 0))), ["and accelerations (2) at point #0."]),
    Answer(
        "A9 effort", goal(point(1.0, START, (), (), (1, 1, 1))), ["only supported for controllers using the 'effort'"]
    ),
    Answer("A7 no positions, integrated", goal(point(1.0, (), ZERO)), (), INTEGRATING),
    Answer(
        "A7 nothing to integrate",
        goal(to(0.5, 1), point(1.0, ())),
        ["The given trajectory has no position, velocity, or acceleration points.", "#1"],
        INTEGRATING,
    ),
    Answer(
        "A10 0.1", last_velocity(0.1), ["last trajectory point of joint j2 is not zero: 0.100000000000000", "1.19e-07"]
    ),
    Answer("A10 2e-7", last_velocity(2e-7), ["is not zero: 0.000000200000000"]),
    Answer("A10 1e-8", last_velocity(1e-8)),
    Answer("A10 allowed", last_velocity(0.1), (), MOVING_END),
    Answer(
        "A11 over", goal(to(0.25, 2), stamp_s=999.0), ["start time (999.000000)", "past (999.250000)", "1000.000000"]
    ),
    Answer("A11 ends now", goal(to(0.25, 2), stamp_s=999.75)),
    Answer("A14 nan", goal(to(1.0, np.nan)), ["Position of joint j1 at point #0 is not finite: nan"]),
    Answer("A14 inf", goal(to(0.5, 1), to(1.0, -np.inf)), ["Position of joint j1 at point #1 is not finite: -inf"]),
    Answer("A14 nan velocity", goal(point(1.0, START, (0, np.nan, 0))), ["Velocity of joint j2 at point #0", "nan"]),
    Answer("A14 repeated", goal(*ONE_POINT, names=["j1", "j1", "j1"]), ["Joint j1 is named more than once"]),
    Answer("A14 negative time", goal(to(-0.1, 2), to(1, 2)), ["Time of point 0 is negative, it is -0.100000"]),
    Answer(
        "A14 surplus", goal(point(1.0, START, (0, 0, 0, 1))), ["joint_names size (3) and velocities (4) at point #0."]
    ),
]


@pytest.mark.parametrize("case", ANSWERS, ids=lambda case: case.id)
def test_goals_are_accepted_or_refused_with_the_words_of_ros2_controllers(case: Answer) -> None:
    bench = Bench(case.parameters)
    refusal = bench.send(case.goal)
    assert (refusal is None) == (not case.refusal)
    assert all(words in refusal.text for words in case.refusal)
    assert refusal is None or refusal.text.startswith("c: ")
    bench.step(150)
    assert [result.status for _, result in bench.results] == ([] if case.refusal else [GoalStatus.SUCCEEDED])


REFUSED = {
    ErrorCode.INVALID_JOINTS: [
        goal(*ONE_POINT, names=["j1", "j2"]),
        goal(*ONE_POINT, names=["j1", "j2", "x"]),
        goal(*ONE_POINT, names=["j1", "j1", "j2"]),
    ],
    ErrorCode.OLD_HEADER_TIMESTAMP: [goal(to(0.25, 2), stamp_s=999.0)],
    ErrorCode.INVALID_GOAL: [goal(), goal(to(1.0, np.nan)), goal(to(1, 1), to(1, 1)), last_velocity(1.0)],
}


@pytest.mark.parametrize(
    ("code", "request_"), [(code, request) for code, requests in REFUSED.items() for request in requests]
)
def test_a_refusal_has_the_error_code_of_the_action(code: ErrorCode, request_: TrajectoryGoal) -> None:
    refusal = Bench().send(request_)
    assert isinstance(refusal, TrajectoryRefusal)
    assert refusal.error_code == code


def test_a_trajectory_stamped_by_another_clock_gives_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench()
    assert bench.send(goal(to(1.0, 2.1), stamp_s=1003.0)) is None
    assert caplog.text == ""
    assert bench.send(goal(to(1.0, 2.1), stamp_s=1.7e9)) is None
    assert "the trajectory starts 1699999000 s from now; was it stamped by a clock" in caplog.text
