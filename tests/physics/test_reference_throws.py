"""Throws at 1 kHz against reference values of an earlier model.

The place of the cup on the handle and the direction of its first wall are not part of the references: both were fitted
to these two throws. The tests hold the model where it is; they do not confirm the spoon independently.

The reference landing points are where the ball's lowest point (not its centre) crosses z = 0, interpolated between two
steps: with the centre, both throws would land 9 to 12 mm further.
"""

import numpy as np
import pytest
from tests.physics.conftest import Thrower

from throwcollect.config.schema import Config
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.talos import TALOS

FINE = {"sim": {"physics_hz": 1000}, "record": {"rate_hz": 1000}}
LONG = {"duration": 0.95, "arm_right_4_joint": -0.2, "arm_right_7_joint": 0.55}


@pytest.fixture(scope="module")
def thrown():
    """The default throw and the long one at 1 kHz: samples, and time of release."""
    one = Thrower(Config.model_validate(FINE))
    throws = []
    for options in ({}, LONG):
        samples = one.throw(**options)
        (spoon,) = [contact for contact in one.world.contacts() if contact.body == "spoon"]
        throws.append((samples, spoon.end_ns / 1e9))
    one.world.close()
    return throws


# The references are rounded to 1 mm, and at 1 kHz the release is known to 1 ms, which scatters landings by up to 1 mm.
# The long throw saturates the shoulder and so depends a little on the spoon's inertia, which is not part of them. Their
# friction was up to 1.4 times as strong between two directions as along them, which held the ball of the long throw
# back: with Coulomb's friction both engines release it 2 ms later, and it lands 3 mm farther.
@pytest.mark.parametrize(
    ("number", "expected", "tolerance_m"), [(0, (1.688, -0.272), 0.001), (1, (2.201, -0.309), 0.003)]
)
def test_reference_throws_land_at_the_reference_point(number, expected, tolerance_m, thrown, landing):
    point, _ = landing(thrown[number][0])
    assert point == pytest.approx(expected, abs=tolerance_m)


@pytest.mark.parametrize(
    ("number", "expected_s", "tolerance_s", "velocity"),
    [(0, 0.638, 0.0015, (2.18, -0.16, 0.34)), (1, 0.598, 0.0025, (2.85, -0.20, 0.06))],
)
def test_reference_throws_are_released_at_the_reference_time_and_velocity(
    number, expected_s, tolerance_s, velocity, thrown
):
    samples, release_s = thrown[number]
    assert release_s == pytest.approx(expected_s, abs=tolerance_s)
    # A step earlier or later changes the vertical velocity by 0.01 m/s.
    at_release = samples.object_linear_velocity[round(release_s * 1000)]
    assert at_release == pytest.approx(velocity, abs=0.015)


def test_peak_effort_of_the_default_throw_is_within_limits(thrown):
    effort = np.abs(thrown[0][0].effort).max(axis=0)
    assert (effort / joint_limits(TALOS).effort).max() == pytest.approx(0.86, abs=0.01)


def test_locking_joints_does_not_change_the_throw(thrown, thrower, landing):
    locked = thrown[0][0]
    full = thrower(**FINE, robot={"locked": "none"}).throw()
    assert np.linalg.norm(landing(locked)[0] - landing(full)[0]) < 2e-4
    assert locked.effort[0, :].nonzero()[0].size == 5
    moving = locked.effort[0].nonzero()[0]
    assert locked.effort[0, moving] == pytest.approx(full.effort[0, moving], abs=2e-3)


def test_landing_converges_with_the_time_step(thrown, thrower, landing):
    points = {
        hz: landing(thrower(sim={"physics_hz": hz}, record={"rate_hz": hz}).throw())[0] for hz in (250, 500, 4000)
    }
    points[1000] = landing(thrown[0][0])[0]
    # A release up to one step late and steps of first order in flight: each about 1 mm at 500 Hz, in proportion to dt.
    for hz in (250, 500, 1000):
        assert np.linalg.norm(points[hz] - points[4000]) < 2.0 / hz
    assert np.linalg.norm(points[250] - points[4000]) > np.linalg.norm(points[1000] - points[4000])


def test_torso_yaw_of_the_start_posture_turns_the_throw(thrower, landing):
    points = []
    for yaw in (-0.3, 0.0, 0.4):
        start = {**thrower().config.task.start, "torso_1_joint": yaw}
        one = thrower(task={"start": start})
        points.append(landing(one.throw(torso_1_joint=yaw))[0])
    radii = [float(np.hypot(*point)) for point in points]
    bearings = [float(np.arctan2(*point[::-1])) for point in points]
    assert radii == pytest.approx([radii[1]] * 3, abs=1e-3)
    assert np.diff(bearings) == pytest.approx([0.3, 0.4], abs=1e-3)
