"""Samples at another rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.episode.record import Samples
from throwcollect.extras import lazily
from throwcollect.units import NS_PER_S

interpolate = lazily("scipy.interpolate", extra="export")


def count_resampled(samples: int, *, recorded_hz: int, rate_hz: int) -> int:
    """Count the samples that `resample` makes of a number of recorded ones."""
    return (samples - 1) * rate_hz // recorded_hz + 1


def resample(samples: Samples, *, recorded_hz: int, rate_hz: int) -> Samples:
    """Compute samples at a lower rate, or the same, from the first recorded one to the last instant within the record.

    If the rate divides the recorded one, these are every n-th recorded sample. Otherwise positions of joints and ball
    lie on the cubic through positions and velocities of both neighbours; all else is linear between them, and the
    ball's orientation is normalised. Nothing is filtered.
    """
    if recorded_hz % rate_hz == 0:
        return samples[:: recorded_hz // rate_hz]
    count = count_resampled(len(samples), recorded_hz=recorded_hz, rate_hz=rate_hz)
    # In units of the recorded spacing, so that instants of recorded samples are hit exactly.
    places = np.arange(count) * recorded_hz / rate_hz
    orientation = _interpolate_linearly(_remove_flips(samples.ball_orientation_xyzw), places)
    return Samples(
        stamps_ns=samples.stamps_ns[0] + np.round(np.arange(count) * (NS_PER_S / rate_hz)).astype(np.int64),
        position=_interpolate_cubically(samples.position, samples.velocity / recorded_hz, places),
        velocity=_interpolate_linearly(samples.velocity, places),
        effort=_interpolate_linearly(samples.effort, places),
        ball_position=_interpolate_cubically(samples.ball_position, samples.ball_linear_velocity / recorded_hz, places),
        ball_orientation_xyzw=orientation / np.linalg.norm(orientation, axis=1, keepdims=True),
        ball_linear_velocity=_interpolate_linearly(samples.ball_linear_velocity, places),
        ball_angular_velocity=_interpolate_linearly(samples.ball_angular_velocity, places),
    )


def _interpolate_linearly(values: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    before = np.minimum(places.astype(np.intp), len(values) - 1)
    after = np.minimum(before + 1, len(values) - 1)
    share = (places - before)[:, np.newaxis]
    between: NDArray[np.float64] = (1 - share) * values[before] + share * values[after]
    return between


def _interpolate_cubically(
    values: NDArray[np.float64], slopes: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    if len(values) < 2:
        return values[: len(places)]
    curve: NDArray[np.float64] = interpolate.CubicHermiteSpline(np.arange(len(values)), values, slopes)(places)
    return curve


def _remove_flips(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose, of the two quaternions of each orientation, the one that is near the quaternion before."""
    # Each flip turns the sign of all quaternions that follow, so that two flips cancel out.
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0
    signs = np.where(np.cumsum(turns) % 2, -1.0, 1.0)
    return np.vstack([quaternions[:1], quaternions[1:] * signs[:, np.newaxis]])
