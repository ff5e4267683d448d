"""Measures the joints in an episode, for any task, and finds the reasons for which joints make a trial fail."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.control.values import GoalStatus
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.robots.description import robot_of
from throwcollect.robots.robot import joint_limits, shares_of
from throwcollect.robots.trajectory import JointTrajectory, sample_positions
from throwcollect.tasks.result import AnyResult, Result
from throwcollect.tasks.result_columns import Peak

_SLACK = 1e-3
_AT_LIMIT = 1 - _SLACK


def measure_joints(
    result: AnyResult, samples: Samples, start_ns: int, *, config: Config, trajectory: JointTrajectory
) -> AnyResult | None:
    """Measure how close the joints came to their limits, and how well they followed their trajectory.

    Returns:
        The result with these measures; None if the samples of the joints are not finite.
    """
    robot = robot_of(config)
    limits = joint_limits(robot)
    effort_limits = limits.effort * config.robot.effort_scale
    velocity_peak = _find_peak(shares_of(np.abs(samples.velocity).max(axis=0), limits.velocity), robot.joints)
    effort_peak = _find_peak(shares_of(np.abs(samples.effort).max(axis=0), effort_limits), robot.joints)
    # A sum is not finite if any of its terms is not.
    if not math.isfinite(velocity_peak.share + effort_peak.share + samples.position.sum()):
        return None
    moving = [robot.joints.index(joint) for joint in trajectory.joints]
    middle = (limits.lower[moving] + limits.upper[moving]) / 2
    # One row per joint, so that arithmetic runs along memory.
    measured = samples.position.T[moving]
    positions = shares_of(np.abs(measured - middle[:, np.newaxis]).max(axis=1), limits.upper[moving] - middle)
    desired = sample_positions(trajectory, samples.seconds_since(start_ns)).T
    errors = np.abs(measured - desired).max(axis=1)
    # Only the results of trials with a policy have this measure.
    clipped: dict[str, Any] = {}
    if config.task.policy is not None:
        asked, sent = samples.command.swapaxes(0, 1)
        clipped["clipped_share"] = float((asked != sent).any(axis=1).mean())
    saturated = 0.0
    # In most trials, no torque reaches its limit, and the samples need not be searched.
    if effort_peak.share >= _AT_LIMIT:
        saturated = float((shares_of(samples.effort, effort_limits) >= _AT_LIMIT).any(axis=1).mean())
    return replace(
        result,
        position_peak=_find_peak(positions, trajectory.joints),
        velocity_peak=velocity_peak,
        effort_peak=effort_peak,
        effort_saturated_share=saturated,
        tracking_error_rad=dict(zip(trajectory.joints, errors.tolist(), strict=True)),
        **clipped,
    )


def explain_failed_goal(header: EpisodeHeader) -> str | None:
    """Say which controller did not carry out its trajectory, and why; None if all controllers did."""
    for goal in header.goals:
        if goal.status in (GoalStatus.CANCELED, GoalStatus.ABORTED):
            detail = f": {goal.error_string}" if goal.error_string else f" with error code {goal.error_code}"
            return f"{goal.controller} {GoalStatus(goal.status).name.lower()} its goal{detail}"
    return None


def explain_violation(result: Result) -> str | None:
    """Say which joint violated a limit; None if no joint did.

    The measured position or velocity of a joint may not exceed its limit, and its torque may not reach its limit.
    Limits have a tolerance of 0.1 % (of half the range, for positions). Joints that do not move may rest at the end of
    their range, so positions are checked only for moving joints, but velocities and torques for all joints.
    """
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


def _find_peak(shares: NDArray[np.float64], joints: tuple[str, ...]) -> Peak:
    column = int(shares.argmax())
    return Peak(joint=joints[column], share=float(shares[column]))
