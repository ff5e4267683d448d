"""Samples of exported throws at another rate."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.episode.record import Samples
from throwcollect.publish.export.throw_source import count_resampled, resample


def polynomial(rate_hz: int, count: int) -> Samples:
    """Positions cubic in time and velocities their derivative; all else linear."""
    t = (np.arange(count) / rate_hz)[:, np.newaxis]
    rate = np.arange(1, 33) / 10
    axis = np.array([1.0, 2.0, 3.0])
    turn = np.hstack([0 * t, 0 * t, np.sin(t), np.cos(t)])
    return Samples(
        stamps_ns=np.round(7_000_000_000 + np.arange(count) * 1e9 / rate_hz).astype(np.int64),
        position=rate * t**2 - t**3,
        velocity=2 * rate * t - 3 * t**2,
        effort=rate * t - 1,
        object_position=axis * t**3 + 1,
        object_orientation_xyzw=turn,
        object_linear_velocity=3 * axis * t**2,
        object_angular_velocity=axis * t,
    )


def test_a_rate_that_divides_the_recorded_one_takes_every_nth_sample_unchanged() -> None:
    recorded = polynomial(250, 101)
    for rate_hz, step in ((250, 1), (125, 2), (50, 5), (25, 10), (1, 250)):
        given = resample(recorded, recorded_hz=250, rate_hz=rate_hz)
        assert len(given) == count_resampled(101, recorded_hz=250, rate_hz=rate_hz)
        for name, column in vars(given).items():
            assert np.array_equal(column, getattr(recorded, name)[::step]), name


@pytest.mark.parametrize("rate_hz", [240, 100, 60, 30, 7])
def test_resampling_interpolates_positions_by_cubics_and_the_rest_linearly(rate_hz: int) -> None:
    given = resample(polynomial(250, 101), recorded_hz=250, rate_hz=rate_hz)
    count = len(given)
    assert (count - 1) / rate_hz <= 100 / 250 < count / rate_hz
    exact = polynomial(rate_hz, count)
    assert np.abs(given.stamps_ns - exact.stamps_ns).max() <= 1
    for name in ("position", "effort", "object_position", "object_angular_velocity"):
        np.testing.assert_allclose(getattr(given, name), getattr(exact, name), rtol=0, atol=1e-12, err_msg=name)
    # Velocities are parabolas here: a chord departs from them by their second derivative times the spacing squared / 8.
    for name, curvature in (("velocity", 6.0), ("object_linear_velocity", 18.0)):
        np.testing.assert_allclose(
            getattr(given, name), getattr(exact, name), rtol=0, atol=curvature / 250**2 / 8 + 1e-12, err_msg=name
        )


def test_resampled_orientations_stay_unit_quaternions_when_signs_flip() -> None:
    recorded = polynomial(250, 101)
    recorded.object_orientation_xyzw[40:70] *= -1
    given = resample(recorded, recorded_hz=250, rate_hz=240)
    exact = polynomial(240, len(given)).object_orientation_xyzw
    np.testing.assert_allclose(np.linalg.norm(given.object_orientation_xyzw, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(np.abs(np.sum(given.object_orientation_xyzw * exact, axis=1)), 1, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [240, 100, 1])
def test_a_single_sample_is_resampled_to_a_single_sample(rate_hz: int) -> None:
    given = resample(polynomial(250, 1), recorded_hz=250, rate_hz=rate_hz)
    assert {len(column) for column in vars(given).values()} == {1}
