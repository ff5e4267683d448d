"""Curves pass through their points with the velocities and accelerations that both ends of a segment have."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.control.interpolation import Curve, interpolate
from throwcollect.control.values import JointState, Trajectory, TrajectoryPoint
from throwcollect.control.waypoints import Waypoints, arrange

from .bench import seconds, through

JOINTS = ("a", "b")
values = st.tuples(st.floats(-5, 5), st.floats(-5, 5))
lengths_ns = st.integers(1_000_000, 3_000_000_000)


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    time_ns, points = draw(lengths_ns), []
    for _ in range(draw(st.integers(1, 5))):
        content = draw(st.integers(0, 2))
        fields = [draw(values) if field <= content else () for field in range(3)]
        points.append(TrajectoryPoint(time_ns, *fields))
        time_ns += draw(lengths_ns)
    return through(points, JOINTS)


def curve_of(trajectory: Trajectory, start=(0.5, -0.5), velocity=(0.2, -0.2)) -> Curve:
    state = JointState(np.array(start), np.array(velocity))
    return interpolate(arrange(trajectory, JOINTS, np.zeros(2), state, 0), state, 0)


@settings(max_examples=200, deadline=None)
@given(trajectory=trajectories())
def test_a_segment_has_positions_velocities_and_accelerations_of_both_ends(trajectory: Trajectory) -> None:
    curve = curve_of(trajectory)
    rows = trajectory.times_ns, trajectory.positions, trajectory.velocities, trajectory.accelerations
    first, *later = itertools.starmap(TrajectoryPoint, zip(*rows, strict=True))
    fields = [(0.5, -0.5), (0.2, -0.2) if len(first.velocities) else (), (0, 0) if len(first.accelerations) else ()]
    points = [TrajectoryPoint(0, *fields), first, *later]
    for before, after in itertools.pairwise(points):
        both = [
            len(before.velocities) and len(after.velocities),
            len(before.accelerations) and len(after.accelerations),
        ]
        begin = curve.state(before.time_from_start_ns)
        end = curve.state(after.time_from_start_ns - 1)
        assert begin[0] == pytest.approx(before.positions, abs=1e-9)
        assert end[0] == pytest.approx(after.positions, abs=1e-5)
        duration_s = (after.time_from_start_ns - before.time_from_start_ns) / 1e9
        if both[0]:
            assert begin[1] == pytest.approx(before.velocities, abs=1e-6)
            assert end[1] == pytest.approx(after.velocities, rel=1e-3, abs=1e-3 / duration_s)
            assert both[1] == 0 or begin[2] == pytest.approx(before.accelerations, abs=1e-6)
            assert both[1] == 0 or end[2] == pytest.approx(after.accelerations, rel=1e-3, abs=1e-3 / duration_s**2)
        else:
            slope = np.subtract(after.positions, before.positions) / duration_s
            assert begin[1] == pytest.approx(slope, rel=1e-9, abs=1e-9)
            assert not begin[2].any()


@settings(max_examples=50, deadline=None)
@given(trajectory=trajectories())
def test_a_curve_gives_the_same_positions_for_many_times_and_for_single_times(trajectory: Trajectory) -> None:
    curve = curve_of(trajectory)
    times_ns = np.linspace(0, trajectory.times_ns[-1] * 1.1, 50).astype(np.int64)
    singly = [curve.state(int(time_ns))[0] for time_ns in times_ns]
    assert np.array_equal(curve.positions(times_ns), singly)


def test_cubic_segments_reproduce_a_cubic() -> None:
    # x³ - 2x has value and slope (0, -2) at 0 and (4, 10) at 2, and the second derivative 12 there.
    points = [TrajectoryPoint(seconds(1), (0, 0), (-2, -2)), TrajectoryPoint(seconds(3), (4, 4), (10, 10))]
    position, velocity, acceleration = curve_of(through(points, JOINTS)).state(seconds(3) - 1)
    assert (position[0], velocity[0], acceleration[0]) == pytest.approx((4, 10, 12), abs=1e-6)


def test_quintic_segments_reproduce_a_quintic() -> None:
    # x(x-1)(x-2)(x-3)(x-4) from 0 to 2: in the middle, ros2_controllers expects (0, -6, 10).
    points = [
        TrajectoryPoint(seconds(1), (0, 0), (24, 24), (-100, -100)),
        TrajectoryPoint(seconds(3), (0, 0), (4, 4), (0, 0)),
    ]
    position, velocity, acceleration = curve_of(through(points, JOINTS)).state(seconds(2))
    assert (position[0], velocity[0], acceleration[0]) == pytest.approx((0, -6, 10), abs=1e-6)


def test_a_curve_starts_with_the_measured_velocity() -> None:
    curve = curve_of(through([TrajectoryPoint(seconds(0.5), (2.1, 0), (0, 0))], JOINTS), (1.6, 0), (1, 0))
    assert curve.positions(np.array([seconds(0.01)]))[0, 0] == pytest.approx(1.610196, abs=1e-6)


def test_a_curve_keeps_position_and_velocity_of_its_last_point() -> None:
    curve = curve_of(through([TrajectoryPoint(seconds(1), (2, 3), (0.5, 0.25))], JOINTS))
    position, velocity, acceleration = curve.state(seconds(5))
    assert (position.tolist(), velocity.tolist(), acceleration.tolist()) == ([2, 3], [0.5, 0.25], [0, 0])


def test_accelerations_without_velocities_are_ignored() -> None:
    points = [TrajectoryPoint(seconds(time), (time, 0), (), (9, 9)) for time in (1, 2)]
    assert curve_of(through(points, JOINTS)).state(seconds(1.5))[0][0] == pytest.approx(1.5)


def test_points_in_the_past_are_not_blended_with_the_measured_state() -> None:
    state, start_ns = JointState(np.array((9.0, 9.0))), seconds(0.5)
    trajectory = through([TrajectoryPoint(0, (1, 1)), TrajectoryPoint(seconds(1), (2, 2))], JOINTS)
    curve = interpolate(arrange(trajectory, JOINTS, np.zeros(2), state, start_ns), state, start_ns)
    assert curve.positions(np.array([seconds(0.5), seconds(0.75)]))[:, 0] == pytest.approx([1.5, 1.75])


def test_a_curve_of_a_single_point_holds_it_from_the_start() -> None:
    curve = interpolate(Waypoints.single(np.array((1.0, 2.0))), JointState(np.array((9.0, 9.0))), 0)
    assert curve.end_ns == 0
    assert curve.positions(np.array([0, 10**18])).tolist() == [[1, 2], [1, 2]]


def test_joints_that_are_left_out_keep_their_command() -> None:
    trajectory = through([TrajectoryPoint(1, (5,), (6,), (7,)), TrajectoryPoint(2, (8,))], ("b",))
    waypoints = arrange(trajectory, JOINTS, np.array((0.25, 9.0)), JointState(np.array((0.25, 9.0))), 0)
    assert waypoints.positions.tolist() == [[0.25, 5], [0.25, 8]]
    assert waypoints.velocities.tolist() == [[0, 6], [0, 0]]
    assert waypoints.accelerations.tolist() == [[0, 7], [0, 0]]
    assert waypoints.content.tolist() == [2, 0]
