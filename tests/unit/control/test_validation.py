"""The order in which the rules for a trajectory are checked; their texts are in the acceptance cases."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from throwcollect.control import validation
from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.values import Trajectory

from .bench import SHIPPED, goal, point, seconds, through, to

NOW_NS = seconds(1000)
NAN, SLOW = (np.nan, 0, 0), (0.1, 0, 0)
EFFORT = (1.0, 1.0, 1.0)


def refusal(trajectory: Trajectory, parameters: ControllerParameters, now_ns: int) -> str | None:
    reason = validation.find_refusal(trajectory, parameters, now_ns)
    return None if reason is None else reason.text


# Each trajectory breaks the rule of its text, and rules that are checked later.
ORDER = [
    ("don't match the controller joints", goal(names=["x"])),
    ("Empty trajectory received", goal(names=["x", "x", "x"])),
    ("Incoming joint x doesn't match", goal(point(-1, (1,)), names=["x", "x", "j1"])),
    ("Joint j1 is named more than once", goal(point(-1, (1,)), names=["j1", "j1", "j2"])),
    ("positions (1) at point #1", goal(point(1, NAN), point(-1, (1,), (1, 1), (), EFFORT), stamp_s=1)),
    ("Position of joint j1 at point #0 is not finite", goal(point(-1, NAN, SLOW, (), EFFORT), stamp_s=1)),
    ("Velocity of last trajectory point", goal(point(-1, (1, 2, 3), SLOW, (), EFFORT), stamp_s=1)),
    ("ends in the past", goal(point(-1, (1, 2, 3), (), (), EFFORT), stamp_s=1)),
    ("Time of point 0 is negative", goal(point(-1, (1, 2, 3), (), (), EFFORT), to(-2, 1))),
    ("is not strictly increasing", goal(point(1, (1, 2, 3), (), (), EFFORT), to(0.5, 1))),
    ("'effort' command interface", goal(point(1, (1, 2, 3)), point(2, (1, 2, 3), (), (), (1,)))),
]


@pytest.mark.parametrize(("words", "request_"), ORDER, ids=[words for words, _ in ORDER])
def test_a_refusal_names_the_first_broken_rule(words: str, request_) -> None:
    assert words in refusal(request_.trajectory, SHIPPED, NOW_NS)


def test_empty_joint_names_are_reported_before_missing_points() -> None:
    partial = dataclasses.replace(SHIPPED, allow_partial_joints_goal=True)
    assert refusal(through([], []), partial, NOW_NS).startswith("Empty joint names")


def test_points_may_lack_velocities_and_accelerations() -> None:
    mixed = goal(point(1, (1, 2, 3), (4, 5, 6)), point(2, (1, 2, 3)), point(3, (1, 2, 3), (0, 0, 0), (7, 8, 9)))
    assert refusal(mixed.trajectory, SHIPPED, NOW_NS) is None
    broken = goal(point(1, (1, 2, 3)), point(2, (1, 2, 3), (0, 0, np.inf)), point(3, (1, 2, 3)))
    assert refusal(broken.trajectory, SHIPPED, NOW_NS) == "Velocity of joint j3 at point #1 is not finite: inf"


def test_numpy_arrays_and_tuples_are_valid_in_a_trajectory() -> None:
    assert refusal(goal(point(1, np.array((1.0, 2.0, 3.0)), np.zeros(3))).trajectory, SHIPPED, NOW_NS) is None
    assert "(got j1, j2, j2)" in refusal(goal(to(1, 1), names=("j1", "j2", "j2")).trajectory, SHIPPED, NOW_NS)


@pytest.mark.parametrize("velocity", [1.2e-7, -1.2e-7])
def test_an_end_velocity_counts_as_zero_within_float_precision(velocity: float) -> None:
    assert "is not zero" in refusal(goal(point(1, (1, 2, 3), (0, 0, velocity))).trajectory, SHIPPED, NOW_NS)
    almost = goal(point(1, (1, 2, 3), (0, 0, velocity * 0.99)))
    assert refusal(almost.trajectory, SHIPPED, NOW_NS) is None
