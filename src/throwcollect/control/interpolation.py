"""Curves through the points of a trajectory, evaluated for many times at once.

The degree of a segment follows from what both its ends have: positions give a line, velocities a cubic, accelerations
a quintic. The first segment begins at the start state, which counts as having whatever the first point has.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.values import JointState
from throwcollect.control.waypoints import CUBIC, LINE, QUINTIC, Waypoints

_AFTER_END_NS = np.array([1])
"""Length of the part after the end."""


@dataclass(frozen=True)
class Curve:
    """Positions, velocities and accelerations over time; after the last knot its values are held.

    Coefficients belong to ascending powers of the share of the segment that has passed, one array
    ``(n_knots, n_joints)`` for each power.

    Attributes:
        knots_ns: Start of each segment since the trajectory's start [ns], shape ``(n_knots,)``, int64; the last is
            the end.
        durations_ns: Length of each segment [ns], shape ``(n_knots,)``, int64; 1 for the part after the end.
        position: Coefficients [rad].
        end: Velocity [rad/s] and acceleration [rad/s²] that are held after the end, each of shape ``(n_joints,)``.
    """

    knots_ns: NDArray[np.int64]
    durations_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    end: tuple[NDArray[np.float64], NDArray[np.float64]]

    @cached_property
    def end_ns(self) -> int:
        """Time of the last point since the trajectory's start [ns]."""
        return int(self.knots_ns[-1])

    @cached_property
    def derivatives(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coefficients of velocities [rad/s] and accelerations [rad/s²], which most trajectories do without."""
        seconds = (self.durations_ns / 1e9)[:, np.newaxis]
        velocity = _differentiate(self.position, seconds)
        acceleration = _differentiate(velocity, seconds)
        velocity[0, -1], acceleration[0, -1] = self.end
        return velocity, acceleration

    def positions(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Compute positions [rad], shape ``(n, n_joints)``, at times since the trajectory's start [ns], shape ``(n,)``.

        No time may be before the first knot.
        """
        return self._evaluate(self.position, times_ns)

    def state(self, time_ns: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Compute position, velocity and acceleration at one time.

        Args:
            time_ns: Time since the trajectory's start, not before the first knot [ns].

        Returns:
            Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n_joints,)``.
        """
        if time_ns >= self.end_ns:
            # From the end on, all powers but the lowest have coefficients of 0.
            return self.position[0, -1], *self.end
        times_ns = np.array([time_ns], dtype=np.int64)
        position, velocity, acceleration = (
            self._evaluate(coefficients, times_ns)[0] for coefficients in (self.position, *self.derivatives)
        )
        return position, velocity, acceleration

    def _evaluate(self, coefficients: NDArray[np.float64], times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        segment = np.searchsorted(self.knots_ns, times_ns, side="right") - 1
        share = ((times_ns - self.knots_ns[segment]) / self.durations_ns[segment])[:, np.newaxis]
        # Horner's scheme works in place, because `take` has made a copy.
        chosen = coefficients.take(segment, axis=1)
        value: NDArray[np.float64] = chosen[-1]
        for coefficient in chosen[-2::-1]:
            value *= share
            value += coefficient
        return value


def interpolate(waypoints: Waypoints, start: JointState, start_ns: int) -> Curve:
    """Make a curve from a start state through the points; if the first point's time has come, it begins there instead.

    Args:
        waypoints: The points.
        start: Where to begin.
        start_ns: When, since the trajectory's start [ns].
    """
    if start_ns < waypoints.times_ns[0]:
        waypoints = _prepend_start(waypoints, start, start_ns)
    times_ns, position, durations_ns = waypoints.times_ns, waypoints.positions[np.newaxis], _AFTER_END_NS
    if len(times_ns) > 1:
        durations_ns = np.append(np.diff(times_ns), durations_ns)
        position = _make_splines(waypoints, durations_ns)
    # After the end the position is constant, but velocity and acceleration are held at those of the last point, as
    # upstream does.
    return Curve(times_ns, durations_ns, position, (waypoints.velocities[-1], waypoints.accelerations[-1]))


def quintic(
    step: NDArray[np.float64],
    v0: NDArray[np.float64],
    v1: NDArray[np.float64],
    a0: NDArray[np.float64],
    a1: NDArray[np.float64],
) -> tuple[NDArray[np.float64], ...]:
    """Find polynomials of degree 5 in the share of a segment that has passed, from their values at both ends.

    Args:
        step: End minus start [rad]; all arguments have the same shape.
        v0: Velocity at the start, times the length of the segment [rad].
        v1: Velocity at the end, times the length of the segment [rad].
        a0: Acceleration at the start, times the squared length of the segment [rad].
        a1: Acceleration at the end, times the squared length of the segment [rad].

    Returns:
        Coefficients of the powers from 1 to 5 [rad]; that of power 0 is the start.
    """
    return (
        v0,
        a0 / 2,
        10 * step - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
        -15 * step + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
        6 * step - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1,
    )


def _prepend_start(waypoints: Waypoints, start: JointState, start_ns: int) -> Waypoints:
    still = np.zeros_like(start.positions)
    return Waypoints(
        np.concatenate(([start_ns], waypoints.times_ns)),
        np.vstack((start.positions, waypoints.positions)),
        np.vstack((still if start.velocities is None else start.velocities, waypoints.velocities)),
        np.vstack((still, waypoints.accelerations)),
        np.concatenate((waypoints.content[:1], waypoints.content)),
        np.concatenate((waypoints.content[:1], waypoints.departure)),
    )


def _make_splines(waypoints: Waypoints, durations_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Find the coefficients of the positions; see `Curve`."""
    content = np.minimum(waypoints.departure[:-1], waypoints.content[1:])
    seconds = (durations_ns / 1e9)[:, np.newaxis]
    # The highest degree of any segment decides the size of the tables. Lower ones leave their higher coefficients at 0.
    degree = (1, 3, 5)[int(content.max(initial=LINE))]
    position = np.zeros((degree + 1, *waypoints.positions.shape))
    position[0] = waypoints.positions
    step = np.diff(waypoints.positions, axis=0)
    v0, v1 = waypoints.velocities[:-1] * seconds[:-1], waypoints.velocities[1:] * seconds[:-1]
    a0, a1 = waypoints.accelerations[:-1] * seconds[:-1] ** 2, waypoints.accelerations[1:] * seconds[:-1] ** 2
    lines, cubics, quintics = (np.flatnonzero(content == kind) for kind in (LINE, CUBIC, QUINTIC))
    position[1, lines] = step[lines]
    if len(cubics):
        d, v, w = step[cubics], v0[cubics], v1[cubics]
        # These are the coefficients of the cubic Hermite polynomial.
        position[1:4, cubics] = v, 3 * d - 2 * v - w, v + w - 2 * d
    if len(quintics):
        d, v, w, a, b = step[quintics], v0[quintics], v1[quintics], a0[quintics], a1[quintics]
        position[1:6, quintics] = quintic(d, v, w, a, b)
    return position


def _differentiate(coefficients: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(coefficients) == 1:
        return np.zeros_like(coefficients)
    # The polynomials are in the share of the segment and their derivatives in seconds, so each one is divided once
    # more.
    powers = np.arange(1.0, len(coefficients))[:, np.newaxis, np.newaxis]
    return powers * coefficients[1:] / seconds
