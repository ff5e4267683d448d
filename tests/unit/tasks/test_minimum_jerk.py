from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.schema import MinimumJerk
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.minimum_jerk import minimum_jerk_trajectory, point_times

START, END = {"a": -1.9, "b": 0.3, "c": 9.0}, {"b": -0.2, "a": -0.5}


def trajectory(gamma=1.2, duration_s=1.0, points_hz=50.0):
    return minimum_jerk_trajectory(
        START, END, duration_s=duration_s, family=MinimumJerk(gamma=gamma), points_hz=points_hz
    )


def exact(times, gamma, duration_s=1.0):
    x = (times / duration_s) ** gamma
    share = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    return np.array([0.3, -1.9]) + share * np.array([-0.5, 1.4])


@settings(max_examples=50, deadline=None)
@given(gamma=st.floats(0.67, 3), duration_s=st.floats(0.1, 10), points_hz=st.floats(5, 1000))
def test_motion_starts_and_ends_at_rest_at_its_ends(gamma, duration_s, points_hz):
    points = trajectory(gamma, duration_s, points_hz)
    assert points.joints == ("b", "a")
    assert (points.times[0], points.times[-1]) == (0.0, duration_s)
    assert (np.diff(points.times) > 0).all()
    assert points.positions[0].tolist() == [0.3, -1.9]
    assert points.positions[-1].tolist() == [-0.2, -0.5]
    assert not points.velocities[[0, -1]].any()
    assert not points.accelerations[-1].any()
    assert np.isfinite(points.accelerations).all()


@pytest.mark.parametrize("gamma", [0.8, 1.0, 1.2, 2.7])
def test_velocities_and_accelerations_match_the_formula(gamma):
    points = trajectory(gamma)
    inner, h = points.times[1:-1], 1e-5
    before, at, after = (exact(inner + shift, gamma) for shift in (-h, 0, h))
    assert points.positions[1:-1] == pytest.approx(at, abs=1e-14)
    assert points.velocities[1:-1] == pytest.approx((after - before) / (2 * h), abs=1e-6)
    assert points.accelerations[1:-1] == pytest.approx((after - 2 * at + before) / h**2, abs=1e-3)


def test_the_lowest_gamma_still_starts_without_acceleration():
    assert not trajectory(0.67).accelerations[0].any()


@pytest.mark.parametrize(
    ("gamma", "bound"), [(0.7, 2e-4), (0.9, 3e-6), (0.95, 2e-6), (1.0, 1e-14), (1.2, 3e-8), (1.4, 2e-8), (3.0, 1e-7)]
)
def test_quintic_curve_between_points_at_50_hz_is_the_motion(gamma, bound):
    times = np.linspace(0, 1, 4001)
    curve, _, _ = sample_quintic(trajectory(gamma), times)
    assert np.abs(curve - exact(times, gamma)).max() < bound


@given(duration_s=st.floats(0.1, 10), points_hz=st.floats(5, 1000))
def test_points_are_evenly_spaced_up_to_the_end(duration_s, points_hz):
    gaps = np.diff(point_times(duration_s, points_hz=points_hz)) * points_hz
    assert gaps[:-1] == pytest.approx(1.0)
    assert 0.1 - 1e-6 <= gaps[-1] <= 1.1 + 1e-6


def test_end_that_is_a_regular_point_comes_once():
    assert point_times(1.0, points_hz=50).tolist() == [k / 50 for k in range(51)]
    assert point_times(0.3, points_hz=10).tolist() == [0.0, 0.1, 0.2, 0.3]


@given(origin=st.floats(-3, 3), target=st.floats(-3, 3))
def test_last_position_is_the_target_to_the_last_bit(origin, target):
    family = MinimumJerk()
    points = minimum_jerk_trajectory({"a": origin}, {"a": target}, duration_s=0.1, family=family, points_hz=10)
    assert points.positions[-1, 0] == target
