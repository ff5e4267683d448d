"""The quintic curve between the points of a trajectory."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.robots.trajectory import JointTrajectory, sample_positions, sample_quintic


def rest_to_rest(start=1.1, end=2.1, duration=1.0):
    rest = np.zeros((2, 1))
    return JointTrajectory(("j",), np.array([0.0, duration]), np.array([[start], [end]]), rest, rest)


@settings(max_examples=60)
@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.lists(st.floats(0.01, 1), min_size=2, max_size=6))
def test_polynomials_of_degree_five_are_reproduced(coefficients, spans):
    path = np.polynomial.Polynomial(coefficients)
    knots = np.concatenate([[0.0], np.cumsum(spans)])
    trajectory = JointTrajectory(
        ("j",), knots, path(knots)[:, None], path.deriv(1)(knots)[:, None], path.deriv(2)(knots)[:, None]
    )
    times = np.linspace(0, knots[-1], 50)
    scale = 1 + np.abs([path.deriv(order)(times) for order in (0, 1, 2)]).max() * 1e4
    for order, sampled in enumerate(sample_quintic(trajectory, times)):
        assert np.abs(sampled[:, 0] - path.deriv(order)(times)).max() < 1e-11 * scale


def test_the_ends_of_a_trajectory_are_held_before_and_after_it():
    positions, velocities, _ = sample_quintic(rest_to_rest(), np.array([-0.5, 1.0, 1.5]))
    assert positions[:, 0] == pytest.approx([1.1, 2.1, 2.1], abs=1e-14)
    assert velocities[:, 0] == pytest.approx(0, abs=1e-13)


def test_sampling_only_positions_gives_the_same_positions():
    trajectory = rest_to_rest(duration=0.7)
    times = np.linspace(-0.1, 0.9, 33)
    assert (sample_positions(trajectory, times) == sample_quintic(trajectory, times)[0]).all()
