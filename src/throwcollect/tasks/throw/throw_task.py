"""The task of throwing: finds outcome and measures of a throw from its recorded samples and contacts."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, cast

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.engines.engine import GROUND
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.reproducible_math import add_up
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.surroundings import object_of
from throwcollect.robots.tools.tool import tool_of
from throwcollect.tasks.result import Outcome
from throwcollect.tasks.result_columns import ObjectState
from throwcollect.tasks.task import Failure, Task
from throwcollect.tasks.throw.flight import (
    Flight,
    flight_after,
    flight_residual,
    release_of,
    spin_after,
    without_impact,
)
from throwcollect.tasks.throw.throw_config import SwingConfig
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult
from throwcollect.units import NS_PER_S

_LEAST_SHARE = 0.25
"""Least speed of a throwing spoon, over the speed of a fall through the depth of its cup [-]: 0.20 m/s by default.

A ball leaves a still spoon by its weight alone with 0.41 m/s at least (0.52 of that fall); so below this threshold, the
ball owes more of its speed to its weight than to the spoon. Of 143 balls that landed after simulated motions from
random postures that hold the ball, 43 had left at a share below 0.03, most of them after the arm had come to rest; the
shares of the others spread evenly above that. Sampled throws of the product's own configurations are above 0.9.

The energy that the ball gains is no criterion: it was up to 4.3 J/kg when a still spoon lost the ball after lifting it,
and as low as -2.1 J/kg when the ball was thrown with 1.8 m/s in a downward swing.
"""


class ThrowTask(Task[ThrowResult]):
    """The arm swings from start to end, and the ball leaves the tool when the tool brakes.

    Between ``tracking_failed`` and ``limit_violated`` (see `Task.judge`) come these outcomes; the first one that
    holds counts. Everything that can be measured is measured in any case, so a throw that landed has a landing whatever
    its outcome is:

    1. ``dropped``: the ball was not in the tool at the start.
    2. ``not_released``: no contact with the tool ended for at least `task.recatch_gap_s` or to the end of the record.
    3. ``dropped``: the tool hardly moved, or not in the direction of the ball, when the ball left it (see
       `explain_drop`).
    4. ``self_hit`` or ``recaught``: between release and landing the ball touched a link of the robot, or the tool
       again; the first touch decides.
    5. ``body_hit``: the ball touched a body of the scene before it landed.
    6. ``timeout``: the ball's lowest point did not cross the landing plane downwards after the release.

    Release, apex and landing are interpolated between samples: positions are on the cubic through the positions and
    velocities of both neighbours, and velocities are linear between them. If the landing plane is low, the ground may
    press on the ball before the sample after the landing; then a computed state of free flight replaces that sample.
    """

    outcomes: ClassVar[type[Outcome]] = ThrowOutcome
    results = ThrowResult
    reasons = "Why the throw did not simply land; null if it did."
    report = "throwcollect.publish.report.throw.throw_sections:report_throws"

    def assess(
        self, result: ThrowResult, samples: Samples, header: EpisodeHeader
    ) -> tuple[ThrowResult, Failure | None]:
        """Measure the flight, and find what kept the ball from landing; see `Task.assess`."""
        config, gap_s = self.config, cast("SwingConfig", self.config.task).recatch_gap_s
        release_ns = release_of(header.contacts, tool=config.tool.name, gap_s=gap_s)
        touched: list[Contact] = []
        impacts: list[Contact] = []
        if release_ns is not None and release_ns <= samples.stamps_ns[-1]:
            flight = flight_after(samples, start_ns=header.start_ns, release_ns=release_ns)
            impacts = [each for each in header.contacts if each.start_ns >= release_ns and self.stands(each.body)]
            if impacts:
                flight = without_impact(flight, header.seconds_at(impacts[0].start_ns), config=config)
            result = self.measure_flight(result, flight)
            touched = self._list_touches(header, release_ns, result.landing.time_s if result.landing else math.inf)
            result = replace(
                result,
                recontacts=len(touched),
                release_spin=spin_after(samples, release_ns),
                ballistic_residual_m=flight_residual(samples, header, config=config),
            )
        failure = self._find_failure(result, samples, header, touched)
        result, miss = self.judge_flight(result, samples, header, impacts)
        return result, failure or miss

    @property
    def landing_height_m(self) -> float:
        """Height of the plane on which the ball lands [m]."""
        return self.config.scene.landing_height_m

    def judge_flight(
        self,
        result: ThrowResult,
        samples: Samples,  # noqa: ARG002 - where the ball ended counts for other tasks
        header: EpisodeHeader,
        impacts: Sequence[Contact],
    ) -> tuple[ThrowResult, Failure | None]:
        """Measure where the ball of a throw ended, and find why that is no success.

        Args:
            result: The result, with the measures of the flight.
            samples: The recorded trial.
            header: Contacts, goals and start of the trial.
            impacts: Contacts after the release with the ground and the bodies of the scene, by time.
        """
        if result.landing is None and impacts and impacts[0].body != GROUND:
            at = f"the ball touched {impacts[0].body} at {header.seconds_at(impacts[0].start_ns):.3f} s"
            return result, Failure(ThrowOutcome.BODY_HIT, at)
        if result.landing is None:
            reason = f"the ball did not reach the landing plane; the trial ended as {header.end_reason}"
            return result, Failure(ThrowOutcome.TIMEOUT, reason)
        return result, None

    def _find_failure(
        self, result: ThrowResult, samples: Samples, header: EpisodeHeader, touched: list[Contact]
    ) -> Failure | None:
        """Find why the ball was not thrown, or touched the robot."""
        tool, outcome = self.config.tool.name, self.outcomes
        if reason := find_early_loss(samples, header, config=self.config):
            return Failure(outcome("dropped"), reason)
        if result.release is None:
            return Failure(outcome("not_released"), f"the ball stayed in the {tool}")
        if reason := explain_drop(samples, header, result.release, config=self.config):
            return Failure(outcome("dropped"), reason)
        if touched:
            first = touched[0]
            time_s = header.seconds_at(first.start_ns)
            if first.body == tool:
                return Failure(outcome("recaught"), f"the {tool} touched the ball again at {time_s:.3f} s")
            return Failure(outcome("self_hit"), f"the ball touched {first.body} at {time_s:.3f} s")
        return None

    def _list_touches(self, header: EpisodeHeader, release_ns: int, end_s: float) -> list[Contact]:
        """List the contacts with the robot between release and landing; contacts with the tool must have begun then."""

        def counts(contact: Contact) -> bool:
            if self.stands(contact.body) or header.seconds_at(contact.start_ns) >= end_s:
                return False
            if contact.body == self.config.tool.name:
                return contact.start_ns >= release_ns
            return contact.end_ns is None or contact.end_ns > release_ns

        return sorted(filter(counts, header.contacts), key=lambda contact: contact.start_ns)

    def measure_flight(self, result: ThrowResult, flight: Flight) -> ThrowResult:
        """Add the measures of a flight to a result."""
        release = flight.knot_state(0)
        crossing = flight.landing(self.landing_height_m + object_of(self.config).radius_m)
        last, landing = crossing or (len(flight.times) - 1, None)
        speed, elevation = _compute_direction(release)
        return replace(
            result,
            release=release,
            release_speed_mps=speed,
            release_elevation_rad=elevation,
            apex=flight.apex(last + 1),
            landing=landing,
            flight_time_s=landing.time_s - release.time_s if landing else None,
            hit_angle_rad=-_compute_direction(landing)[1] if landing else None,
        )


def _compute_direction(ball: ObjectState) -> tuple[float, float]:
    """Compute the speed [m/s] and the elevation of the direction of flight above the horizontal [rad]."""
    vx, vy, vz = ball.velocity
    level = math.hypot(vx, vy)
    return math.hypot(level, vz), math.atan2(vz, level)


def find_early_loss(samples: Samples, header: EpisodeHeader, *, config: Config) -> str | None:
    """Explain why a trial began without a ball in the tool; None if the ball was in the tool.

    A ball that does not press on the tool at the start may be bouncing a little: it counts as in the tool if it is no
    farther than the rim's radius from the place where it would rest, and touches the tool later.
    """
    held = [contact.start_ns for contact in header.contacts if contact.body == config.tool.name]
    if held and min(held) > header.start_ns:
        seat = ToolMotion(config).place(samples.position[0])
        if math.dist(samples.object_position[0], seat) > tool_of(config).rim_radius_m:
            held = []
    if held:
        return None
    return (
        f"the ball had left the {config.tool.name} before the start, in the sim.settle_s = {config.sim.settle_s} s for "
        "settling"
    )


def explain_drop(samples: Samples, header: EpisodeHeader, release: ObjectState, *, config: Config) -> str | None:
    """Explain why a ball that left the tool was not thrown by it; None if it was thrown.

    The tool threw the ball if the tool moved in the direction that the ball then took, at a quarter or more of the
    speed of a fall through the depth of the cup. When the tool brakes, the ball still has to roll over the rim. So the
    highest speed counts that the tool had while the ball, at its own speed, covered the radius of the rim.
    """
    speed, cup = math.hypot(*release.velocity), tool_of(config)
    direction = [part / (speed or 1.0) for part in release.velocity]
    least = _LEAST_SHARE * math.sqrt(2 * config.scene.gravity_mps2 * cup.depth_m)
    release_ns = header.start_ns + round(release.time_s * NS_PER_S)
    since_ns = release_ns - (cup.rim_radius_m / speed * NS_PER_S if speed else math.inf)
    last = min(int(np.searchsorted(samples.stamps_ns, release_ns)), len(samples) - 1)
    tool = ToolMotion(config)
    fastest = -math.inf
    # The search goes backwards, because the last samples before the release are enough to recognise most throws.
    for row in range(last, -1, -1):
        velocity = tool.velocity(samples.position[row], samples.velocity[row]).tolist()
        fastest = max(fastest, add_up(map(operator.mul, direction, velocity)))
        if fastest >= least:
            return None
        if samples.stamps_ns[row] <= since_ns:
            break
    moved = math.dist(tool.place(samples.position[last]), tool.place(samples.position[0]))
    height = release.position[2] - samples.object_position[0, 2]
    work = config.scene.gravity_mps2 * height + (speed**2 - math.hypot(*samples.object_linear_velocity[0]) ** 2) / 2
    name = config.tool.name
    return (
        f"the {name} did not throw the ball: it left at {release.time_s:.3f} s with {speed:.2f} m/s, and the {name} "
        f"went that way at {fastest:z.2f} m/s, not {least:.2f} m/s; until then, the {name} had moved by "
        f"{moved * 1000:.1f} mm and done {work:z.2f} J/kg of work on the ball"
    )
