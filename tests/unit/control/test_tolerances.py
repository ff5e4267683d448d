"""Tolerances of goals are resolved as in ros2_controllers."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.control.tolerances import Tolerances, violations
from throwcollect.control.values import JointTolerance, TrajectoryGoal

from .bench import JOINTS, seconds, through

LIMITS = JointConstraints(trajectory=0.1, goal=0.1)
CONSTRAINTS = Constraints(goal_time=0.1, stopped_velocity_tolerance=0.1, joints=dict.fromkeys(JOINTS, LIMITS))
LOGGER = logging.getLogger("c")


def resolve(path=(), goal=(), late_ns: int = 0) -> tuple[list[float], list[float], int]:
    asked = TrajectoryGoal(through((), ()), path, goal, late_ns)
    found = Tolerances.of(ControllerParameters(JOINTS, constraints=CONSTRAINTS)).merge(asked, logger=LOGGER)
    return found.path.tolist(), found.goal.tolist(), found.goal_time_ns


UNCHANGED = ([0.1, 0.1, 0.1], [0.1, 0.1, 0.1], seconds(0.1))


def test_a_goal_without_tolerances_has_the_defaults() -> None:
    assert resolve() == UNCHANGED


def test_positive_tolerances_of_a_goal_replace_the_defaults_in_any_joint_order() -> None:
    path = [JointTolerance("j3", 0.4), JointTolerance("j1", 0.2), JointTolerance("j2", 0.3)]
    goal = [JointTolerance("j2", 2.1, 0.5, 0.5), JointTolerance("j1", 1.1)]
    assert resolve(path, goal, seconds(2)) == ([0.2, 0.3, 0.4], [1.1, 2.1, 0.1], seconds(2))


def test_a_tolerance_of_minus_one_switches_the_check_off() -> None:
    off = [JointTolerance(joint, -1.0, -1.0, -1.0) for joint in JOINTS]
    assert resolve(off, off, seconds(-1)) == ([0, 0, 0], [0, 0, 0], 0)
    assert resolve([JointTolerance("j1", -1.0 + 1e-8)]) == ([0, 0.1, 0.1], *UNCHANGED[1:])


ILLEGAL = [
    ((), (), seconds(-123)),
    ([JointTolerance("j1", 0.5), JointTolerance("j2", -123)], (), 0),
    ([JointTolerance("j1", 0.5, -123)], (), seconds(2)),
    ([JointTolerance("j1", 0.5, 0, -123)], (), 0),
    ((), [JointTolerance("j1", 0.5), JointTolerance("j2", -1.1)], 0),
    ((), [JointTolerance("j1", 0.5), JointTolerance("joint123")], seconds(2)),
    ([JointTolerance("joint123", 0.5)], [JointTolerance("j1", 0.5)], 0),
]


@pytest.mark.parametrize(("path", "goal", "late_ns"), ILLEGAL)
def test_a_single_illegal_number_or_joint_restores_all_default_tolerances(path, goal, late_ns, caplog) -> None:
    assert resolve(path, goal, late_ns) == UNCHANGED
    (record,) = caplog.records
    assert record.getMessage().endswith("Using default tolerances.")


def test_joints_without_constraints_are_not_checked() -> None:
    constraints = Constraints(joints={"j2": JointConstraints(goal=0.5)})
    found = Tolerances.of(ControllerParameters(JOINTS, constraints=constraints))
    assert (found.path.tolist(), found.goal.tolist()) == ([0, 0, 0], [0, 0.5, 0])


def test_an_error_equal_to_the_tolerance_is_within_it() -> None:
    error = np.array((0.5, -0.5000001, 7.0))
    assert violations(error, np.array((0.5, 0.5, 0.0)), JOINTS) == (
        "joint j2 has position error -0.5000001 rad, tolerance 0.5 rad"
    )
    assert violations(error, np.full(3, 8.0), JOINTS) == ""


def test_every_joint_outside_its_tolerance_is_named() -> None:
    text = violations(np.array((1.0, 0.0, -2.0)), np.full(3, 0.25), JOINTS)
    assert text == (
        "joint j1 has position error 1 rad, tolerance 0.25 rad; joint j3 has position error -2 rad, tolerance 0.25 rad"
    )
