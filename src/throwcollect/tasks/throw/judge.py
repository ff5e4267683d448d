"""The judge of a throw: from recorded samples and contacts to an outcome and its numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.robots.description import robot_of
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.quintic_curve import sample_positions
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.throw.config import throw_section
from throwcollect.tasks.throw.drop import drop, lost_before_start
from throwcollect.tasks.throw.flight import NS_PER_S, Flight, flight_after, release_of, without_impact
from throwcollect.tasks.throw.outcome import BallState, Outcome, Peak, ThrowResult

__all__ = ["BallState", "Outcome", "Peak", "ThrowResult", "judge"]

_SLACK = 1e-3
_AT_LIMIT = 1 - _SLACK
_FAILED_GOALS = {5: "canceled", 6: "aborted"}


def judge(
    samples: Samples,
    header: EpisodeHeader,
    *,
    config: Config,
    trajectory: JointTrajectory,
) -> ThrowResult:
    """Find the outcome and the numbers of one trial.

    The first of these that holds is the outcome; whatever can be measured is measured all the same, so that a throw
    that landed keeps its landing under any outcome:

    1. ``tracking_failed``: a sample is not finite (then nothing is measured), or a goal was canceled or aborted.
    2. ``dropped``: the ball was not in the spoon at the start.
    3. ``not_released``: no contact with the spoon ended for at least `task.recatch_gap_s` or to the end of the record.
    4. ``dropped``: the spoon hardly moved, or not the way of the ball, when the ball left it (see `drop`).
    5. ``self_hit`` or ``recaught``: between release and landing the ball touched a link of the robot, or the spoon
       again; what it touched first decides.
    6. ``timeout``: the ball's lowest point did not cross the landing plane downwards after the release.
    7. ``limit_violated``: the measured position or velocity of a joint exceeds its limit, or its torque reaches it.
       Limits count with a tolerance of 0.1 % (of half the range, for positions). Held joints may rest at the end of
       their range, so positions count for the moving joints only, velocities and torques for all.
    8. ``landed``.

    Release, apex and landing lie between samples: positions on the cubic through the positions and velocities of both
    neighbours, velocities linear between them. If the ground has pressed on the ball by the sample after the landing,
    as it can below a low landing plane, free flight takes that sample's place.

    Args:
        samples: The recorded trial, at least two samples.
        header: Contacts, goals and start of the trial; the trajectory starts at its `start_ns`.
        config: Configuration of the trial.
        trajectory: What the controllers were sent, followed as quintic curve and then held at its end.
    """
    result = _joint_measures(samples, header.start_ns, config=config, trajectory=trajectory)
    if not (result and math.isfinite(samples.ball_position.sum() + samples.ball_linear_velocity.sum())):
        return ThrowResult(Outcome.TRACKING_FAILED, reason="the samples hold numbers that are not finite")
    release_ns = release_of(header.contacts, gap_s=throw_section(config.task).recatch_gap_s)
    touched: list[Contact] | None = None
    if release_ns is not None and release_ns <= samples.stamps_ns[-1]:
        flight = flight_after(samples, start_ns=header.start_ns, release_ns=release_ns)
        if impacts := [contact.start_ns for contact in header.contacts if contact.body == "ground"]:
            flight = without_impact(flight, (min(impacts) - header.start_ns) / NS_PER_S, config=config)
        result = _flight_measures(result, flight, config)
        touched = _touches(header, release_ns, result.landing.time_s if result.landing else math.inf)
    outcome, reason = _outcome(result, samples, header, config, touched)
    return replace(result, outcome=outcome, reason=reason, recontacts=None if touched is None else len(touched))


def _outcome(
    result: ThrowResult, samples: Samples, header: EpisodeHeader, config: Config, touched: list[Contact] | None
) -> tuple[Outcome, str | None]:
    for goal in header.goals:
        if goal.status in _FAILED_GOALS:
            detail = f": {goal.error_string}" if goal.error_string else f" with error code {goal.error_code}"
            return Outcome.TRACKING_FAILED, f"{goal.controller} {_FAILED_GOALS[goal.status]} its goal{detail}"
    if reason := lost_before_start(samples, header, config=config):
        return Outcome.DROPPED, reason
    if result.release is None:
        return Outcome.NOT_RELEASED, "the ball stayed in the spoon"
    if reason := drop(samples, header, result.release, config=config):
        return Outcome.DROPPED, reason
    if touched:
        first = touched[0]
        time_s = (first.start_ns - header.start_ns) / NS_PER_S
        if first.body == "spoon":
            return Outcome.RECAUGHT, f"the spoon touched the ball again at {time_s:.3f} s"
        return Outcome.SELF_HIT, f"the ball touched {first.body} at {time_s:.3f} s"
    if result.landing is None:
        return Outcome.TIMEOUT, f"the ball did not reach the landing plane; the trial ended as {header.end_reason}"
    if reason := _violation(result):
        return Outcome.LIMIT_VIOLATED, reason
    return Outcome.LANDED, None


def _violation(result: ThrowResult) -> str | None:
    if (peak := result.position_peak) and peak.share > 1 + _SLACK:
        return f"{peak.joint} left its range: {peak.share:.3f} of the way from its middle to its limit"
    if (peak := result.velocity_peak) and peak.share > 1 + _SLACK:
        return f"{peak.joint} moved at {peak.share:.3f} of its velocity limit"
    if (peak := result.effort_peak) and result.effort_saturated_share:
        return (
            f"{peak.joint} reached {peak.share:.3f} of its effort limit; efforts were saturated in "
            f"{result.effort_saturated_share:.1%} of the samples"
        )
    return None


def _touches(header: EpisodeHeader, release_ns: int, end_s: float) -> list[Contact]:
    """Contacts with spoon or robot that began, or with the robot also lasted, between release and landing."""

    def counts(contact: Contact) -> bool:
        if contact.body == "ground" or (contact.start_ns - header.start_ns) / NS_PER_S >= end_s:
            return False
        if contact.body == "spoon":
            return contact.start_ns >= release_ns
        return contact.end_ns is None or contact.end_ns > release_ns

    return sorted(filter(counts, header.contacts), key=lambda contact: contact.start_ns)


def _flight_measures(result: ThrowResult, flight: Flight, config: Config) -> ThrowResult:
    release = flight.knot_state(0)
    found = flight.landing(config.scene.landing_height_m + config.ball.radius_m)
    last, landing = found or (len(flight.times) - 1, None)
    speed, elevation = _direction(release)
    return replace(
        result,
        release=release,
        release_speed_mps=speed,
        release_elevation_rad=elevation,
        apex=flight.apex(last + 1),
        landing=landing,
        flight_time_s=landing.time_s - release.time_s if landing else None,
        hit_angle_rad=-_direction(landing)[1] if landing else None,
    )


def _direction(ball: BallState) -> tuple[float, float]:
    """Speed [m/s] and elevation of the direction of flight above the horizontal [rad]."""
    vx, vy, vz = ball.velocity
    level = math.hypot(vx, vy)
    return math.hypot(level, vz), math.atan2(vz, level)


def _joint_measures(
    samples: Samples, start_ns: int, *, config: Config, trajectory: JointTrajectory
) -> ThrowResult | None:
    """Result with the joints' measures alone, its outcome yet to be decided; None if they are not finite."""
    robot = robot_of(config)
    limits = joint_limits(robot)
    effort_limits = limits.effort * config.robot.effort_scale
    velocity_peak = _peak(np.abs(samples.velocity).max(axis=0) / limits.velocity, robot.joints)
    effort_peak = _peak(np.abs(samples.effort).max(axis=0) / effort_limits, robot.joints)
    if not math.isfinite(velocity_peak.share + effort_peak.share + samples.position.sum()):
        return None
    moving = [robot.joints.index(joint) for joint in trajectory.joints]
    middle = (limits.lower[moving] + limits.upper[moving]) / 2
    # A row a joint, so that arithmetic runs along memory.
    measured = samples.position.T[moving]
    positions = np.abs(measured - middle[:, np.newaxis]).max(axis=1) / (limits.upper[moving] - middle)
    desired = sample_positions(trajectory, (samples.stamps_ns - start_ns) / NS_PER_S).T
    errors = np.abs(measured - desired).max(axis=1)
    saturated = 0.0
    if effort_peak.share >= _AT_LIMIT:
        saturated = float((np.abs(samples.effort) / effort_limits >= _AT_LIMIT).any(axis=1).mean())
    return ThrowResult(
        Outcome.LANDED,
        position_peak=_peak(positions, trajectory.joints),
        velocity_peak=velocity_peak,
        effort_peak=effort_peak,
        effort_saturated_share=saturated,
        tracking_error_rad=dict(zip(trajectory.joints, errors.tolist(), strict=True)),
    )


def _peak(shares: NDArray[np.float64], joints: tuple[str, ...]) -> Peak:
    column = int(shares.argmax())
    return Peak(joint=joints[column], share=float(shares[column]))
