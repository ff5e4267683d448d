"""The order in which the rules for a trajectory are checked; their texts are in the acceptance cases."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.control import ControllerParameters, Trajectory, validation

from .bench import SHIPPED, goal, point, seconds, to

NOW_NS = seconds(1000)


def refusal(trajectory: Trajectory, parameters: ControllerParameters, now_ns: int) -> str | None:
    reason = validation.refusal(trajectory, parameters, now_ns)
    return None if reason is None else reason.text


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
