"""Points of a trajectory in a controller's joint order, with values for everything that the trajectory leaves out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.values import JointState, Rows, Trajectory

_LONGEST_BRAKING_S = 60.0
"""Longest time for which a joint brakes: at a speed far above that of any robot, the points would fill all memory."""
LINE, CUBIC, QUINTIC = 0, 1, 2
"""What a point has, named after the curve that it allows: positions alone, velocities too, accelerations too."""


@dataclass(frozen=True)
class Waypoints:
    """Points of a trajectory in the controller's joint order.

    Attributes:
        times_ns: Time since the trajectory's start [ns], shape ``(n_points,)``, int64.
        positions: [rad], shape ``(n_points, n_joints)``.
        velocities: [rad/s], shape ``(n_points, n_joints)``; 0 where a point has none.
        accelerations: [rad/s²], shape ``(n_points, n_joints)``; 0 where a point has none.
        content: What each point has as the end of a segment, shape ``(n_points,)``: `LINE`, `CUBIC` or `QUINTIC`.
        departure: The same as the start of the next segment: a point from which the next one is integrated counts as
            having what that takes, as upstream, which completes it only when it comes to that segment.
    """

    times_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    content: NDArray[np.int64]
    departure: NDArray[np.int64]

    @classmethod
    def single(
        cls,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64] | None = None,
        accelerations: NDArray[np.float64] | None = None,
    ) -> Waypoints:
        """Make one point at the trajectory's start, to be held; velocities and accelerations of None are 0."""
        still = np.zeros(len(positions))
        rows = [still if row is None else row for row in (positions, velocities, accelerations)]
        p, v, a = (row[np.newaxis] for row in rows)
        line = np.array([LINE])
        return cls(np.zeros(1, np.int64), p, v, a, line, line)


def arrange(
    trajectory: Trajectory, joints: Sequence[str], command: NDArray[np.float64], start: JointState, start_ns: int
) -> Waypoints:
    """Bring the points of a valid trajectory into the controller's order, with values for all of its joints.

    Args:
        trajectory: The trajectory that was asked for.
        joints: Joints of the controller, in order.
        command: Last commanded positions [rad], shape ``(n_joints,)``: joints that are left out stay there.
        start: Where the trajectory begins: points without positions are integrated from there.
        start_ns: When, since the trajectory's start [ns]; points before that are over.
    """
    columns = [joints.index(name) for name in trajectory.joint_names]
    times_ns = np.array(trajectory.times_ns, dtype=np.int64)
    positions = np.repeat(command[np.newaxis], len(times_ns), axis=0)
    velocities, accelerations = np.zeros((2, *positions.shape))
    placed = _place(positions, columns, trajectory.positions)
    moving = _place(velocities, columns, trajectory.velocities)
    accelerating = _place(accelerations, columns, trajectory.accelerations)
    content = np.where(moving, CUBIC, LINE)
    # Accelerations without velocities do not count, as upstream's quintic needs both.
    content[moving & accelerating] = QUINTIC
    waypoints = Waypoints(times_ns, positions, velocities, accelerations, content, content)
    if placed.all():
        return waypoints
    return _integrate(waypoints, (placed, moving, accelerating), columns, start, start_ns)


def brake(
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    deceleration: NDArray[np.float64],
    period_ns: int,
) -> Waypoints:
    """Make a trajectory on which each joint brakes from its speed to rest, at its own deceleration, within a minute.

    Args:
        positions: Where the joints are [rad], shape ``(n_joints,)``.
        velocities: How they move [rad/s], shape ``(n_joints,)``.
        deceleration: How hard they brake [rad/s²], above 0, shape ``(n_joints,)``.
        period_ns: Control period [ns]: the distance between the points.

    Returns:
        One point a period from now to the first at which all joints rest.
    """
    # `fmin` leaves out speeds that are no numbers, which a physics engine may have for goals far beyond all robots.
    stopping_s = np.fmin(np.abs(velocities) / deceleration, _LONGEST_BRAKING_S)
    count = math.ceil(stopping_s.max() * 1e9 / period_ns) + 1
    times_ns = np.arange(count, dtype=np.int64) * period_ns
    seconds = (times_ns / 1e9)[:, np.newaxis]
    braking = np.minimum(seconds, stopping_s)
    towards = np.where(
        stopping_s < _LONGEST_BRAKING_S, -np.sign(velocities) * deceleration, -velocities / _LONGEST_BRAKING_S
    )
    moves = seconds < stopping_s
    content = np.full(count, QUINTIC)
    return Waypoints(
        times_ns,
        positions + velocities * braking + towards / 2 * braking**2,
        np.where(moves, velocities + towards * braking, 0.0),
        np.where(moves, towards, 0.0),
        content,
        content,
    )


def _place(table: NDArray[np.float64], columns: list[int], rows: Rows) -> NDArray[np.bool_]:
    """Write rows that are not empty into these columns of a table; return which these are, shape ``(n_points,)``."""
    present = np.fromiter(map(len, rows), bool, len(rows))
    if present.all():
        table[:, columns] = rows
    elif present.any():
        table[np.ix_(present, np.array(columns))] = [values for values in rows if len(values)]
    return present


def _integrate(
    waypoints: Waypoints,
    present: tuple[NDArray[np.bool_], ...],
    columns: list[int],
    start: JointState,
    start_ns: int,
) -> Waypoints:
    """Fill in positions, and velocities too where a point has accelerations alone, by the trapezoidal rule."""
    placed, moving, accelerating = present
    positions, velocities, content = waypoints.positions.copy(), waypoints.velocities.copy(), waypoints.content.copy()
    departure = content.copy()
    still = np.zeros(positions.shape[1])
    # If the time of the first point has passed, the joints count as being there, so nothing is integrated backwards.
    time_ns = min(start_ns, int(waypoints.times_ns[0]))
    p = start.positions
    v, a = still if start.velocities is None else start.velocities, still
    for index in range(len(positions)):
        seconds = (int(waypoints.times_ns[index]) - time_ns) / 1e9
        if not placed[index]:
            if not moving[index]:
                gained = (a + waypoints.accelerations[index]) / 2 * seconds
                velocities[index, columns] = (v + gained)[columns]
            content[index] = QUINTIC if accelerating[index] else CUBIC
            departure[index] = content[index]
            if index:
                # The velocity of the point before is 0 if it has none; so is its acceleration, if that is needed, too.
                is_quintic = not moving[index] or accelerating[index - 1]
                departure[index - 1] = QUINTIC if is_quintic else CUBIC
            positions[index, columns] = (p + (v + velocities[index]) / 2 * seconds)[columns]
        time_ns = int(waypoints.times_ns[index])
        p, v, a = positions[index], velocities[index], waypoints.accelerations[index]
    return replace(waypoints, positions=positions, velocities=velocities, content=content, departure=departure)
