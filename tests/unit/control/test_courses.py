"""Commands and results of a goal, with the numbers of ros2_controllers' joint trajectory controller."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.values import ErrorCode, GoalStatus, TrajectoryGoal

from .bench import (
    CANCELED,
    FROZEN,
    INTEGRATING,
    LAG,
    OFF_PATH,
    OFFSET,
    PARTIAL,
    REACHED,
    SHIPPED,
    START,
    TALOS,
    TOO_LATE,
    ZERO,
    Bench,
    Plant,
    braking,
    constrain,
    goal,
    point,
    seconds,
    to,
)


@dataclass(frozen=True)
class Course:
    """A goal with the commands of joint 1 by update, and the result with the update in which it comes."""

    id: str
    goal: TrajectoryGoal
    commands: dict[int, float] = field(default_factory=dict)
    decided: tuple[int, GoalStatus, ErrorCode, str] | None = None
    parameters: ControllerParameters = SHIPPED
    plant: Plant = field(default_factory=Plant)
    deviations: dict[str, bool] = field(default_factory=dict)
    start: Sequence[float] = START
    idle: int = 0
    updates: int = 150
    during: dict[int, Callable[[Bench], object]] = field(default_factory=dict)
    final: Sequence[float] | None = None


def cancel(bench: Bench) -> None:
    assert bench.controller.cancel("A")


def scale(factor: float) -> Callable[[Bench], object]:
    return lambda bench: bench.controller.scale_speed(factor)


def put_on_target(bench: Bench) -> None:
    bench.plant.position = np.array((1.6, 2.1, 3.1))


WITH_PATH = constrain(trajectory=0.05)


THREE_QUARTERS = (3 * math.pi / 2, 0, 0)


QUINTIC = {1: 1.100010, 25: 1.203516, 50: 1.6, 75: 1.996484, 100: 2.1}


COURSES = [
    Course("B1 linear", goal(to(1.0, 2.1)), {1: 1.11, 50: 1.6, 99: 2.09, 100: 2.1, 101: 2.1}, (100, *REACHED)),
    Course(
        "B2 cubic", goal(to(1.0, 2.1, 3)), {1: 1.100298, 25: 1.25625, 50: 1.6, 75: 1.94375, 100: 2.1}, (100, *REACHED)
    ),
    Course("B3 quintic", goal(to(1.0, 2.1, 5)), QUINTIC, (100, *REACHED)),
    Course(
        "B5 mixed",
        goal(point(1.0, (1, 0, 0), ZERO), point(2.0, (2, 0, 0))),
        {100: 1.0, 150: 1.5, 200: 2.0},
        (200, *REACHED),
        start=ZERO,
        updates=220,
    ),
    Course(
        "B7 two points",
        goal(point(0.2, (4, 5, 6)), point(0.3, (7, 8, 9))),
        {10: 2.55, 20: 4.0, 25: 5.5, 30: 7.0},
        (30, *REACHED),
        final=(7, 8, 9),
    ),
    Course(
        "B8 other order", goal(point(0.25, (2, 3, 1)), names=["j2", "j3", "j1"]), {}, (25, *REACHED), final=(1, 2, 3)
    ),
    Course(
        "B9 partial",
        goal(point(0.25, (2, 1)), names=["j2", "j1"]),
        {},
        (25, *REACHED),
        parameters=PARTIAL,
        final=(1, 2, 3.1),
    ),
    Course("B11 first point now", goal(to(0.0, 2.1), to(1.0, 3.1)), {1: 2.11, 100: 3.1}, (100, *REACHED)),
    Course("single point now", goal(to(0.0, 2.1)), {1: 2.1}, (1, *REACHED)),
    Course(
        "B12 future stamp",
        goal(to(0.5, 2.6), stamp_s=1001.1),
        {1: 1.110067, 100: 2.106711, 149: 2.6},
        (149, *REACHED),
        idle=10,
    ),
    Course(
        "B14 stamp of the client",
        goal(to(2.0, 2.1), stamp_s=1000.49),
        {1: 1.105051},
        (198, *REACHED),
        idle=50,
        updates=210,
    ),
    Course("past stamp, point ahead", goal(to(1.0, 2.1), stamp_s=1000.5), {1: 1.120408}, (49, *REACHED), idle=100),
    Course(
        "past stamp, point over",
        goal(to(0.25, 2.1), to(1.5, 3.1), stamp_s=1000.5),
        {1: 2.316},
        (99, *REACHED),
        idle=100,
    ),
    Course(
        "B16 revolute joint",
        goal(point(1.0, THREE_QUARTERS)),
        {1: 0.047124, 50: 2.356194, 100: 4.712389},
        (100, *REACHED),
        start=ZERO,
    ),
    Course(
        "B17 velocities alone",
        goal(*(point(time, (), (velocity, 0, 0)) for time, velocity in ((1.0, 1), (2.0, 2), (3.0, 1)))),
        {50: 0.125, 100: 0.5, 150: 1.125, 200: 2.0, 250: 2.875, 300: 3.5},
        (300, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=310,
    ),
    Course(
        "B17 accelerations alone",
        goal(*(point(time, (), (), (2.0, 0, 0)) for time in (1.0, 2.0))),
        {100: 0.5, 200: 2.5},
        (200, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=210,
    ),
    Course(
        "position, then velocity alone",
        goal(point(1.0, (1.0, 0, 0)), point(2.0, (), (1.0, 0, 0))),
        {50: 0.5, 150: 1.125, 200: 1.5},
        (200, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=210,
    ),
    Course(
        "position, then acceleration alone",
        goal(point(1.0, (1.0, 0, 0)), point(2.0, (), (), (1.0, 0, 0))),
        {50: 0.5, 150: 1.0625, 200: 1.25},
        (200, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=210,
    ),
    Course(
        "position and velocity, then acceleration alone",
        goal(point(1.0, (1.0, 0, 0), (0.5, 0, 0)), point(2.0, (), (), (1.0, 0, 0))),
        {50: 0.4375, 150: 1.3125, 200: 1.75},
        (200, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=210,
    ),
    Course(
        "velocity alone, then acceleration alone",
        goal(point(1.0, (), (1.0, 0, 0)), point(2.0, (), (), (-1.0, 0, 0))),
        {100: 0.5, 150: 0.9375, 200: 1.25},
        (200, *REACHED),
        parameters=INTEGRATING,
        start=ZERO,
        updates=210,
    ),
    Course(
        "from the measured state, which lags", goal(to(1.0, 2.1)), {1: 0.813}, (100, *REACHED), plant=OFFSET, idle=5
    ),
    Course("C1 nothing moves after success", goal(to(1.0, 2.1)), {100: 2.1, 101: 2.1, 150: 2.1}, (100, *REACHED)),
    Course("C2 no tolerances", goal(to(0.5, 1.6)), {}, (50, *REACHED), plant=FROZEN),
    Course(
        "C3 too late",
        goal(to(0.5, 1.6)),
        {110: 1.6, 113: 1.1, 150: 1.1},
        (111, GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, TOO_LATE + "0.6"),
        parameters=TALOS,
        plant=FROZEN,
    ),
    Course(
        "goal brings its time tolerance",
        goal(to(0.5, 1.6), goal_time_tolerance_ns=seconds(2)),
        {},
        (252, GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, TOO_LATE + "2.0"),
        parameters=TALOS,
        plant=FROZEN,
        updates=300,
    ),
    Course(
        "C5 waits for ever",
        goal(to(0.5, 1.6), goal_time_tolerance_ns=seconds(-1)),
        {2050: 1.6},
        None,
        parameters=TALOS,
        plant=FROZEN,
        updates=2050,
    ),
    Course(
        "C6 no time limit",
        goal(to(0.5, 1.6)),
        {3000: 1.6},
        (3001, *REACHED),
        parameters=constrain(goal=0.02),
        plant=FROZEN,
        updates=3010,
        during={3000: put_on_target},
    ),
    Course("first-order lag", goal(to(0.5, 1.6)), {}, (67, *REACHED), parameters=TALOS, plant=LAG),
    Course(
        "C8 off the path",
        goal(to(1.0, 2.1)),
        {11: 1.21, 12: 1.21, 13: 1.1, 50: 1.1},
        (12, GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, OFF_PATH),
        parameters=constrain(trajectory=0.105),
        plant=FROZEN,
    ),
    Course(
        "C9 off the path at once",
        goal(to(0.0, 2.1)),
        {1: 1.1, 2: 1.1, 50: 1.1},
        (1, GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, OFF_PATH),
        parameters=constrain(trajectory=1e-4),
        plant=FROZEN,
    ),
    Course(
        "C10 goal brings its tolerance",
        goal(to(0.5, 1.6), goal_tolerance=("j1", 0.6)),
        {},
        (50, *REACHED),
        parameters=TALOS,
        plant=FROZEN,
    ),
    Course(
        "C11 goal switches the path off",
        goal(to(0.5, 1.6), path_tolerance=("j1", -1)),
        {},
        (50, *REACHED),
        parameters=WITH_PATH,
        plant=FROZEN,
    ),
    Course(
        "an illegal number brings the defaults back",
        goal(to(0.5, 1.6), goal_tolerance=("j1", 0.6, 0.0, -7.0)),
        {},
        (111, GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, TOO_LATE + "0.6"),
        parameters=TALOS,
        plant=FROZEN,
    ),
    Course(
        "C14 velocities do not count",
        goal(to(1.0, 2.1)),
        {},
        (100, *REACHED),
        parameters=TALOS,
        plant=Plant(velocity=5.0),
    ),
    Course(
        "D3 cancel",
        goal(to(1.0, 2.1)),
        {50: 1.6, 51: 1.59, 52: 1.59, 150: 1.59},
        (50, *CANCELED),
        during={50: cancel},
    ),
    Course(
        "D4 cancel with an error",
        goal(to(1.0, 2.1)),
        {50: 1.6, 51: 1.29, 150: 1.29},
        (50, *CANCELED),
        plant=OFFSET,
        during={50: cancel},
        final=(0.99, 1.5, 2.5),
    ),
    Course(
        "D4 cancel with an error, holding the command",
        goal(to(1.0, 2.1)),
        {50: 1.6, 51: 1.6, 150: 1.6},
        (50, *CANCELED),
        plant=OFFSET,
        deviations={"holds_command": True},
        during={50: cancel},
        final=(1.3, 1.8, 2.8),
    ),
    Course(
        "C8 off the path, holding the command",
        goal(to(1.0, 2.1)),
        {11: 1.21, 12: 1.21, 13: 1.21, 50: 1.21},
        (12, GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, OFF_PATH),
        parameters=constrain(trajectory=0.105),
        plant=FROZEN,
        deviations={"holds_command": True},
    ),
    Course(
        "D7 cancel by braking",
        goal(to(2.0, 3.1)),
        {100: 2.1, 101: 2.0999, 125: 2.2775, 150: 2.34, 170: 2.34},
        (100, *CANCELED),
        parameters=braking(2.0),
        plant=Plant(velocity=(1.0, 0.0, 0.0)),
        during={100: cancel},
        updates=170,
    ),
    Course(
        "off the path, braking",
        goal(to(1.0, 2.1)),
        {12: 1.21, 13: 1.1099, 38: 1.2924, 63: 1.35, 100: 1.35},
        (12, GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, OFF_PATH),
        parameters=braking(2.0, trajectory=0.105),
        plant=Plant("frozen", velocity=(1.0, 0.0, 0.0)),
    ),
    Course(
        "a command timeout ends an open goal",
        goal(to(0.5, 1.6), goal_time_tolerance_ns=seconds(-1)),
        {120: 1.6, 124: 1.1},
        (122, GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, "Aborted due to command timeout"),
        parameters=dataclasses.replace(TALOS, cmd_timeout=0.7),
        plant=FROZEN,
    ),
    Course(
        "D5 cancel what is over",
        goal(to(0.5, 2.1)),
        {101: 2.1, 150: 2.1},
        (50, *REACHED),
        during={100: lambda bench: bench.controller.cancel("A")},
    ),
    Course(
        "topic over action",
        goal(to(1.0, 2.1)),
        {30: 1.4, 31: 1.392, 80: 1.0},
        (80, *REACHED),
        during={30: lambda bench: bench.controller.replace(goal(to(0.5, 1.0)).trajectory, bench.now_ns)},
    ),
    Course(
        "topic aborts the action, if asked to",
        goal(to(1.0, 2.1)),
        {30: 1.4, 31: 1.392, 80: 1.0},
        (30, GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, "Current goal preempted by a trajectory on the topic."),
        deviations={"topic_aborts_goal": True},
        during={30: lambda bench: bench.controller.replace(goal(to(0.5, 1.0)).trajectory, bench.now_ns)},
    ),
    Course(
        "D11 invalid topic message",
        goal(to(0.5, 1.5)),
        {31: 1.348, 50: 1.5},
        (50, *REACHED),
        during={30: lambda bench: bench.controller.replace(goal(to(-1, 1)).trajectory, bench.now_ns)},
    ),
    Course(
        "another speed on the way",
        goal(to(1.0, 2.1)),
        {50: 1.6, 51: 1.62, 75: 2.1},
        (75, *REACHED),
        during={50: scale(2.0)},
    ),
    Course(
        "E8 stopped and started again",
        goal(to(1.0, 2.1)),
        {50: 1.6, 51: 1.6, 550: 1.6, 551: 1.61, 600: 2.1},
        (600, *REACHED),
        parameters=TALOS,
        during={50: scale(0.0), 550: scale(1.0)},
        updates=610,
    ),
    Course(
        "E8 stopped while a late goal waits",
        goal(to(0.5, 1.6)),
        {400: 1.6},
        (411, GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, TOO_LATE + "0.6"),
        parameters=TALOS,
        plant=FROZEN,
        during={100: scale(0.0), 400: scale(1.0)},
        updates=420,
    ),
    Course(
        "E9 speeds that make no sense",
        goal(to(1.0, 2.1)),
        {31: 1.355, 60: 1.5},
        (120, *REACHED),
        during={20: scale(0.5), 40: scale(-0.12), 50: scale(math.nan), 60: scale(1.0)},
    ),
    Course(
        "A13 refused goal during a motion",
        goal(to(1.0, 2.1)),
        {31: 1.41, 100: 2.1},
        (100, *REACHED),
        during={30: lambda bench: bench.send(goal(), "B")},
    ),
]


@pytest.mark.parametrize("case", COURSES, ids=lambda case: case.id)
def test_a_goal_gives_the_same_commands_and_result_as_in_ros2_controllers(case: Course) -> None:
    plant = dataclasses.replace(case.plant, position=np.array(case.start))
    bench = Bench(case.parameters, plant, **case.deviations)
    bench.step(case.idle)
    assert bench.send(case.goal) is None
    for _ in range(case.updates):
        bench.step()
        if bench.k in case.during:
            case.during[bench.k](bench)
        bench.collect()
    commands = {k: bench.commands[k][0] for k in case.commands}
    assert commands == pytest.approx(case.commands, abs=1e-6)
    if case.decided is None:
        assert bench.results == []
    else:
        k, *expected, text = case.decided
        ((decided, result),) = bench.results
        assert decided == pytest.approx(k, abs=1)
        assert [result.status, result.error_code] == expected
        assert result.error_string.startswith(text)
        assert result.error_string == text or result.error_code < -1
    if case.final is not None:
        assert bench.plant.position == pytest.approx(case.final, abs=1e-6)
