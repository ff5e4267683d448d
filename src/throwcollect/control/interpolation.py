"""Curves through the points of a trajectory, evaluated for many times at once.

The degree of a segment follows from what both its ends have: positions give a line, velocities a cubic, accelerations
a quintic. The first segment begins at the measured state, which counts as having whatever the first point has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.goal import Trajectory

_LINE, _CUBIC, _QUINTIC = 0, 1, 2


@dataclass(frozen=True)
class Waypoints:
    """Points of a trajectory in the controller's joint order.

    Attributes:
        times_ns: Time since the trajectory's start [ns], shape ``(n_points,)``, int64.
        positions: [rad], shape ``(n_points, n_joints)``.
        velocities: [rad/s], shape ``(n_points, n_joints)``; 0 where a point has none.
        accelerations: [rad/s²], shape ``(n_points, n_joints)``; 0 where a point has none.
        content: What a point has, shape ``(n_points,)``: 0 positions, 1 velocities too, 2 accelerations too.
    """

    times_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    content: NDArray[np.int64]

    @classmethod
    def single(
        cls,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64] | None = None,
        accelerations: NDArray[np.float64] | None = None,
    ) -> Waypoints:
        """One point at the trajectory's start, to be held.

        Args:
            positions: [rad], shape ``(n_joints,)``.
            velocities: [rad/s], shape ``(n_joints,)``; None for 0.
            accelerations: [rad/s²], shape ``(n_joints,)``; None for 0.

        Returns:
            The point.
        """
        still = np.zeros(len(positions))
        rows = [still if row is None else row for row in (positions, velocities, accelerations)]
        p, v, a = (row[np.newaxis] for row in rows)
        return cls(np.zeros(1, np.int64), p, v, a, np.zeros(1, np.int64))


def arranged(trajectory: Trajectory, joints: Sequence[str], command: NDArray[np.float64]) -> Waypoints:
    """Points of a valid trajectory in the controller's joint order.

    Args:
        trajectory: What has been asked for.
        joints: Joints of the controller, in order.
        command: Last commanded positions [rad], shape ``(n_joints,)``: joints that are left out stay there.

    Returns:
        The points for all joints of the controller.
    """
    points = trajectory.points
    columns = [joints.index(name) for name in trajectory.joint_names]
    positions = np.repeat(command[np.newaxis], len(points), axis=0)
    positions[:, columns] = [point.positions for point in points]
    velocities, accelerations = np.zeros_like(positions), np.zeros_like(positions)
    moving = [index for index, point in enumerate(points) if len(point.velocities)]
    accelerating = [index for index, point in enumerate(points) if len(point.accelerations)]
    if moving:
        velocities[np.ix_(moving, columns)] = [points[index].velocities for index in moving]
    if accelerating:
        accelerations[np.ix_(accelerating, columns)] = [points[index].accelerations for index in accelerating]
    content = np.zeros(len(points), np.int64)
    content[moving] = _CUBIC
    content[[index for index in accelerating if content[index] == _CUBIC]] = _QUINTIC
    times_ns = np.array([point.time_from_start_ns for point in points], dtype=np.int64)
    return Waypoints(times_ns, positions, velocities, accelerations, content)


@dataclass(frozen=True)
class Curve:
    """Positions, velocities and accelerations over time; after the last knot its values are held.

    Coefficients are those of ascending powers of the share of the segment that has passed, one array
    ``(n_knots, n_joints)`` for each power.

    Attributes:
        knots_ns: Start of each segment since the trajectory's start [ns], shape ``(n_knots,)``, int64; the last is
            the end.
        durations_ns: Length of each segment [ns], shape ``(n_knots,)``, int64; 1 for the part after the end.
        position: Coefficients [rad].
        velocity: Coefficients [rad/s].
        acceleration: Coefficients [rad/s²].
    """

    knots_ns: NDArray[np.int64]
    durations_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]

    @property
    def end_ns(self) -> int:
        """Time of the last point since the trajectory's start [ns]."""
        return int(self.knots_ns[-1])

    def positions(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Positions at many times.

        Args:
            times_ns: Times since the trajectory's start, none before the first knot [ns], shape ``(n,)``.

        Returns:
            [rad], shape ``(n, n_joints)``.
        """
        return self._evaluated(self.position, times_ns)

    def state(self, time_ns: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position, velocity and acceleration at one time.

        Args:
            time_ns: Time since the trajectory's start, not before the first knot [ns].

        Returns:
            Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n_joints,)``.
        """
        times_ns = np.array([time_ns], dtype=np.int64)
        position, velocity, acceleration = (
            self._evaluated(coefficients, times_ns)[0]
            for coefficients in (self.position, self.velocity, self.acceleration)
        )
        return position, velocity, acceleration

    def _evaluated(self, coefficients: NDArray[np.float64], times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        segment = np.searchsorted(self.knots_ns, times_ns, side="right") - 1
        share = ((times_ns - self.knots_ns[segment]) / self.durations_ns[segment])[:, np.newaxis]
        value: NDArray[np.float64] = coefficients[-1][segment]
        for coefficient in coefficients[-2::-1]:
            value *= share
            value += coefficient[segment]
        return value


def interpolated(
    waypoints: Waypoints,
    start_ns: int,
    start_position: NDArray[np.float64],
    start_velocity: NDArray[np.float64] | None,
    *,
    splines: bool,
) -> Curve:
    """Curve from a measured state through the points.

    Args:
        waypoints: The points.
        start_ns: Time at which the state was measured, since the trajectory's start [ns]; points before it are over.
        start_position: Measured positions [rad], shape ``(n_joints,)``.
        start_velocity: Measured velocities [rad/s], shape ``(n_joints,)``; None if they are not measured.
        splines: Whether to connect the points; otherwise the next point is output from the time of each.

    Returns:
        The curve; if the first point's time has come, it begins there and the measured state is not used.
    """
    leads_in = start_ns < waypoints.times_ns[0]
    if leads_in:
        still = np.zeros_like(start_position)
        velocity = still if start_velocity is None else start_velocity
        waypoints = Waypoints(
            np.concatenate(([start_ns], waypoints.times_ns)),
            np.vstack((start_position, waypoints.positions)),
            np.vstack((velocity, waypoints.velocities)),
            np.vstack((still, waypoints.accelerations)),
            np.concatenate((waypoints.content[:1], waypoints.content)),
        )
    durations_ns = np.append(np.diff(waypoints.times_ns), 1)
    if splines and len(durations_ns) > 1:
        return _splines(waypoints, durations_ns)
    rows = np.minimum(np.arange(len(durations_ns)) + 1, len(durations_ns) - 1)
    if leads_in:
        rows[0] = 0
    values = (waypoints.positions, waypoints.velocities, waypoints.accelerations)
    return Curve(waypoints.times_ns, durations_ns, *(value[np.newaxis, rows] for value in values))


def _splines(waypoints: Waypoints, durations_ns: NDArray[np.int64]) -> Curve:
    content = np.minimum(waypoints.content[:-1], waypoints.content[1:])
    seconds = (durations_ns / 1e9)[:, np.newaxis]
    degree = (1, 3, 5)[int(content.max(initial=_LINE))]
    position = np.zeros((degree + 1, *waypoints.positions.shape))
    position[0] = waypoints.positions
    step = np.diff(waypoints.positions, axis=0)
    v0, v1 = waypoints.velocities[:-1] * seconds[:-1], waypoints.velocities[1:] * seconds[:-1]
    a0, a1 = waypoints.accelerations[:-1] * seconds[:-1] ** 2, waypoints.accelerations[1:] * seconds[:-1] ** 2
    lines, cubics, quintics = (np.flatnonzero(content == kind) for kind in (_LINE, _CUBIC, _QUINTIC))
    position[1, lines] = step[lines]
    if len(cubics):
        d, v, w = step[cubics], v0[cubics], v1[cubics]
        position[1:4, cubics] = v, 3 * d - 2 * v - w, v + w - 2 * d
    if len(quintics):
        d, v, w, a, b = step[quintics], v0[quintics], v1[quintics], a0[quintics], a1[quintics]
        position[1:6, quintics] = (
            v,
            a / 2,
            10 * d - 6 * v - 4 * w - 1.5 * a + 0.5 * b,
            -15 * d + 8 * v + 7 * w + 1.5 * a - b,
            6 * d - 3 * v - 3 * w - 0.5 * a + 0.5 * b,
        )
    velocity = _derivative(position, seconds)
    acceleration = _derivative(velocity, seconds)
    velocity[0, -1], acceleration[0, -1] = waypoints.velocities[-1], waypoints.accelerations[-1]
    return Curve(waypoints.times_ns, durations_ns, position, velocity, acceleration)


def _derivative(coefficients: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(coefficients) == 1:
        return np.zeros_like(coefficients)
    powers = np.arange(1.0, len(coefficients))[:, np.newaxis, np.newaxis]
    return powers * coefficients[1:] / seconds
