"""Computes the ball between release and landing: states between samples, and the distance from a ballistic flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.tasks.free_flight import ballistic_positions
from throwcollect.tasks.result_columns import ObjectState, Vector
from throwcollect.tasks.throw.throw_config import SwingConfig
from throwcollect.units import NS_PER_S

BALLISTIC_TOLERANCE_M = 1e-9
"""A recorded flight differs by rounding from the computed one, by less than 1e-12 m; any kick moves a ball by more."""


@dataclass(frozen=True)
class Flight:
    """The ball from its release on: a knot at the release, then one for each later sample.

    Between two knots, the ball is on the cubic that has position and velocity of both knots. Its velocity is taken as
    linear between the knots, which is exact for ballistic motion without drag.

    Attributes:
        times: Time of each knot since the start of the trial [s], shape ``(n_knots,)``.
        positions: Ball centre in world [m], shape ``(n_knots, 3)``.
        velocities: Velocity of the ball in world [m/s], shape ``(n_knots, 3)``.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]

    def state_at(self, time_s: float, *, knot: int) -> ObjectState:
        """Interpolate the ball at a time between a knot, which must not be the last one, and the next knot."""
        before, after = self.times[knot : knot + 2].tolist()
        span = after - before
        u = (time_s - before) / span
        # The cubic Hermite polynomial: `smooth` leads from place to place, and `bump` gives it the velocities.
        smooth, bump = u * u * (3 - 2 * u), span * u * (1 - u)
        # For three numbers, plain Python is faster than an array.
        axes = list(
            zip(*self.positions[knot : knot + 2].tolist(), *self.velocities[knot : knot + 2].tolist(), strict=True)
        )
        x, y, z = (p0 + (p1 - p0) * smooth + bump * (v0 * (1 - u) - v1 * u) for p0, p1, v0, v1 in axes)
        vx, vy, vz = (v0 + (v1 - v0) * u for _, _, v0, v1 in axes)
        return ObjectState(time_s, (x, y, z), (vx, vy, vz))

    def knot_state(self, knot: int) -> ObjectState:
        """Return the state of the ball at a knot."""
        (x, y, z), (vx, vy, vz) = self.positions[knot].tolist(), self.velocities[knot].tolist()
        return ObjectState(float(self.times[knot]), (x, y, z), (vx, vy, vz))

    def landing(self, height: float) -> tuple[int, ObjectState] | None:
        """Find the first downward crossing of a height [m] by the ball's centre.

        Returns:
            The knot before the crossing, and the ball at that instant; None if there is no crossing.
        """
        above = self.positions[:, 2] - height
        crossings = np.flatnonzero((above[:-1] >= 0) & (above[1:] < 0))
        if not len(crossings):
            return None
        knot = int(crossings[0])
        span = float(self.times[knot + 1] - self.times[knot])
        z0, z1 = map(float, above[knot : knot + 2])
        m0, m1 = (float(speed) * span for speed in self.velocities[knot : knot + 2, 2])
        # These are the coefficients, by powers of u, of the height on the cubic of `state_at`.
        u = _find_root((2 * z0 - 2 * z1 + m0 + m1, -3 * z0 + 3 * z1 - 2 * m0 - m1, m0, z0))
        return knot, self.state_at(float(self.times[knot]) + u * span, knot=knot)

    def apex(self, knots: int) -> ObjectState:
        """Find the highest point of the first `knots` knots, at least one, and between them."""
        top = int(np.argmax(self.positions[:knots, 2]))
        speeds = self.velocities[:, 2]
        # The highest point lies next to the highest knot, on the side on which the ball changes from rising to falling.
        for knot in (top - 1, top):
            if 0 <= knot < len(self.times) - 1 and speeds[knot] > 0 > speeds[knot + 1]:
                share = speeds[knot] / (speeds[knot] - speeds[knot + 1])
                time = self.times[knot] + share * (self.times[knot + 1] - self.times[knot])
                return self.state_at(float(time), knot=knot)
        return self.knot_state(top)


def flight_after(samples: Samples, *, start_ns: int, release_ns: int) -> Flight:
    """Cut the flight out of a trial: from its release [ns], which is not after the last sample, to the last sample."""
    after = int(np.searchsorted(samples.stamps_ns, release_ns, side="right"))
    before = max(after - 1, 0)
    times = (samples.stamps_ns[before:] - start_ns) / NS_PER_S
    flight = Flight(times, samples.object_position[before:].copy(), samples.object_linear_velocity[before:].copy())
    release = (release_ns - start_ns) / NS_PER_S
    if release > times[0]:
        first = flight.state_at(release, knot=0)
        flight.times[0], flight.positions[0], flight.velocities[0] = first.time_s, first.position, first.velocity
    return flight


def without_impact(flight: Flight, impact_s: float, *, config: Config) -> Flight:
    """Cut a flight off at its impact, the first step in which the ground pressed on the ball, and continue it freely.

    Returns:
        The knots before the impact, and at the time of the next knot the state to which free flight leads; the flight
        itself if the impact is not between two knots.
    """
    # Subtract half a step, so that rounding cannot pick the next knot.
    knot = int(np.searchsorted(flight.times, impact_s - 0.5 / config.sim.physics_hz))
    if not 0 < knot < len(flight.times):
        return flight
    steps = max(1, round(float(flight.times[knot] - flight.times[knot - 1]) * config.sim.physics_hz))
    before = slice(0, knot)
    path = ballistic_positions(flight.positions[knot - 1], flight.velocities[knot - 1], steps=steps, config=config)
    return Flight(
        flight.times[: knot + 1],
        np.vstack([flight.positions[before], path[-1]]),
        np.vstack([flight.velocities[before], (path[-1] - path[-2]) * config.sim.physics_hz]),
    )


def release_of(contacts: tuple[Contact, ...], *, tool: str, gap_s: float) -> int | None:
    """Find the instant at which the ball left the tool [ns].

    Returns:
        End of the first contact with the tool after which no other contact with it begins within `gap_s`; None if the
        ball never was in the tool or never left it. The end of the record may cut short the gap after the last contact.
    """
    held = sorted((contact for contact in contacts if contact.body == tool), key=lambda contact: contact.start_ns)
    for number, contact in enumerate(held, start=1):
        if contact.end_ns is None:
            return None
        if number == len(held) or held[number].start_ns - contact.end_ns >= gap_s * NS_PER_S:
            return contact.end_ns
    return None


def spin_after(samples: Samples, release_ns: int) -> Vector:
    """Read the angular velocity of the ball in world [rad/s] after its release [ns]; nothing changes it in flight."""
    first = int(np.searchsorted(samples.stamps_ns, release_ns))
    x, y, z = samples.object_angular_velocity[first].tolist()
    return x, y, z


def flight_residual(samples: Samples, header: EpisodeHeader, *, config: Config) -> float | None:
    """Measure how far the recorded flight departs from the discrete ballistic motion of the physics.

    The motion takes, per physics step dt, ``v += (g + drag(v)) dt``, then ``x += v dt``, as the physics does. It starts
    at the first sample `task.recatch_gap_s` after the release, because the contact solver may leave friction impulses
    on a ball that slides off the tool in the steps after its normal force has gone: up to 12 ms were seen, which
    moved the landing by 1 mm. It ends with the first contact after the release, or with the record.

    Both sides then do the same arithmetic in double precision, so they differ by its rounding alone: at most about
    half an ulp of the position per step, less than 1e-12 m after 1000 steps within 4 m. A flight under other physics
    than the recorded ones differs by far more: one impulse that changes the speed by 1e-6 m/s, 10 ms before the
    landing, moves the ball by 1e-8 m.

    Returns:
        The largest distance [m]; None without a release, or with fewer than two such samples.
    """
    gap_s = cast("SwingConfig", config.task).recatch_gap_s
    release_ns = release_of(header.contacts, tool=config.tool.name, gap_s=gap_s)
    if release_ns is None:
        return None
    later = [contact.start_ns for contact in header.contacts if contact.start_ns >= release_ns]
    free_ns = release_ns + round(gap_s * NS_PER_S)
    first = int(np.searchsorted(samples.stamps_ns, free_ns))
    # A contact acts in the physics step that ends at its start, so samples before that instant are untouched.
    stop = int(np.searchsorted(samples.stamps_ns, min(later))) if later else len(samples.stamps_ns)
    if stop - first < 2:
        return None
    stride = config.sim.physics_hz // config.record.rate_hz
    predicted = ballistic_positions(
        samples.object_position[first],
        samples.object_linear_velocity[first],
        steps=stride * (stop - first - 1),
        config=config,
    )
    x, y, z = (samples.object_position[first:stop] - predicted[::stride]).T
    # `numpy.linalg.norm` adds in an order that depends on the processor.
    return float(np.sqrt(x * x + y * y + z * z).max())


def _find_root(cubic: tuple[float, float, float, float]) -> float:
    """Find the root in (0, 1] of a cubic in u, highest power first, that is at least 0 at 0 and negative at 1."""
    a, b, c, d = cubic
    low, high = 0.0, 1.0
    u = 0.5
    for _ in range(60):
        value = ((a * u + b) * u + c) * u + d
        if value >= 0:
            low = u
        else:
            high = u
        slope = (3 * a * u + 2 * b) * u + c
        # Newton's method is used where it stays in the interval that holds the root. Elsewhere the interval is halved;
        # 60 halvings alone would come to the end of double precision.
        newton = u - value / slope if slope else math.inf
        following = newton if low < newton < high else (low + high) / 2
        if abs(following - u) < 1e-15:
            break
        u = following
    return u
