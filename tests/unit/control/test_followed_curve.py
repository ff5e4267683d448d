"""The clock of a motion, and its rows of commands."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.control.followed_curve import Motion
from throwcollect.control.interpolation import interpolate
from throwcollect.control.values import JointState, TrajectoryPoint
from throwcollect.control.waypoints import arrange

from .bench import through

PERIOD_NS = 10


def motion(end_ns: int = 100, first_ns: int = 1000) -> Motion:
    """One joint that goes from 0 at one radian per nanosecond."""
    trajectory = through([TrajectoryPoint(end_ns, (end_ns,))], ("j",))
    start, start_ns = JointState(np.zeros(1)), first_ns - 1000
    curve = interpolate(arrange(trajectory, ("j",), np.zeros(1), start, start_ns), start, start_ns)
    return Motion(curve, start_ns=1000, first_ns=first_ns, period_ns=PERIOD_NS)


def test_the_command_is_one_period_ahead_of_desired_whichever_is_read_first() -> None:
    moving = motion()
    assert (moving.command[0], moving.desired[0]) == pytest.approx((10, 0))
    moving.advance()
    assert (moving.desired[0], moving.command[0]) == pytest.approx((10, 20))


@pytest.mark.parametrize(("end_ns", "past_end"), [(100, 9), (101, 10), (109, 10), (110, 10), (111, 11)])
def test_the_end_of_a_motion_is_noticed_one_period_early(end_ns: int, past_end: int) -> None:
    moving = motion(end_ns)
    assert moving.updates_until_end() == past_end - 1
    seen = []
    for _ in range(13):
        seen.append(moving.past_end)
        moving.advance()
    assert seen.index(True) == past_end
    assert all(seen[past_end:])


def test_rows_of_a_motion_repeat_the_last_point_after_its_end() -> None:
    moving = motion(35)
    assert moving.skip(5)[:, 0] == pytest.approx([20, 30, 35, 35, 35])
    assert moving.clock_ns == 50
    assert moving.since_end_ns == 15
    assert moving.skip(2)[:, 0].tolist() == [35, 35]


@pytest.mark.parametrize(("tolerance_ns", "updates"), [(0, 10), (5, 10), (6, 11), (15, 11), (16, 12)])
def test_a_motion_is_late_only_beyond_its_tolerance(tolerance_ns: int, updates: int) -> None:
    moving = motion(104)
    assert moving.updates_until_late(tolerance_ns) == updates
    moving.skip(updates)
    assert moving.since_end_ns <= tolerance_ns
    moving.advance()
    assert moving.since_end_ns > tolerance_ns
