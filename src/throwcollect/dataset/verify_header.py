"""Checks the header of an episode against its samples: contacts, goals, and why the trial ended."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

import numpy as np

from throwcollect.control import GoalStatus
from throwcollect.dataset.recorded_trial import RecordedTrial, shorten
from throwcollect.episode.record import REST_S, REST_SPEED_MPS
from throwcollect.robots.description import robot_of
from throwcollect.units import NS_PER_S

_LEAST_ERROR_CODE = -5
"""Lowest error code of control_msgs/action/FollowJointTrajectory; 0 is success."""
_ROUNDING = 1e-9


def find_header_problems(trial: RecordedTrial, bodies: Collection[str] | None) -> Iterator[str]:
    """Find what a header says that cannot be, or that its samples contradict, a sentence each.

    `bodies` has the names of all bodies that can touch the ball; None if they are not known.
    """
    yield from _find_contact_problems(trial, bodies)
    yield from _find_goal_problems(trial)
    yield from _find_end_problems(trial)


def _find_contact_problems(trial: RecordedTrial, bodies: Collection[str] | None) -> Iterator[str]:
    contacts = trial.header.contacts
    order = [(contact.start_ns, contact.body) for contact in contacts]
    if order != sorted(order):
        yield "the contacts are not in order of their starts"
    ends: dict[str, int] = {}
    for contact in contacts:
        what = trial.name_contact(contact)
        if bodies is not None and contact.body not in bodies:
            yield f"{what}: no such body can touch the ball"
        interval = trial.steps_of(contact)
        if interval is None:
            yield f"{what} to {contact.end_ns} ns does not begin and end, in this order, on physics steps of the trial"
        else:
            # In the step at which a contact ends, the body is not touched, so its next contact begins later.
            if interval[0] <= ends.get(contact.body, -1):
                yield f"{what} begins before the one before it has ended"
            ends[contact.body] = interval[1]


def _find_goal_problems(trial: RecordedTrial) -> Iterator[str]:
    header, trajectory, robot = trial.header, trial.trajectory, robot_of(trial.config)
    sent = {robot.controller_of(joint) for joint in trajectory.joints}
    expected = [name for name in robot.controllers if name in sent]
    found = [goal.controller for goal in header.goals]
    if found != expected:
        yield f"has goals of {shorten(found)}, the trajectory is sent to {expected}"
    duration_s = float(trial.samples.stamps_ns[-1] - trial.samples.stamps_ns[0]) / NS_PER_S
    for goal in header.goals:
        what = f"the goal of {shorten(goal.controller)}"
        if goal.status not in list(GoalStatus):
            yield f"{what} has the unknown status {goal.status}"
        if not _LEAST_ERROR_CODE <= goal.error_code <= 0:
            yield f"{what} has the unknown error code {goal.error_code}"
        if goal.status in (GoalStatus.EXECUTING, GoalStatus.SUCCEEDED) and goal.error_code:
            yield f"{what} has status {goal.status} and an error code all the same"
        if goal.status == GoalStatus.SUCCEEDED and duration_s < trial.motion_s - _ROUNDING:
            yield f"{what} succeeded, but the trial ended at {duration_s:.3f} s, before its trajectory"


def _find_end_problems(trial: RecordedTrial) -> Iterator[str]:
    samples, header, config = trial.samples, trial.header, trial.config
    # The bounds and conditions here are those by which `World` in `sim` ends a trial.
    last = len(samples) - 1
    most = math.ceil(math.ceil(config.sim.max_trial_s * config.sim.physics_hz) / trial.stride)
    if last > most:
        yield f"has {last + 1} samples; the longest trial has {most + 1}"
    height = samples.ball_position[:, 2] - config.scene.landing_height_m - config.ball.radius_m
    # A ball that lies in the tool may be carried through the plane, which is no landing.
    held = trial.find_pressed([contact for contact in header.contacts if contact.body == config.tool.name])
    crossings = np.flatnonzero((height[1:] < 0) & (height[:-1] >= 0) & ~held[1:]) + 1
    if len(crossings) and crossings[0] < last:
        crossed = trial.format_time(int(samples.stamps_ns[crossings[0]]))
        yield f"the ball crossed the landing plane at {crossed}, and the trial went on"
    elif len(crossings) and header.end_reason != "landed":
        yield f"ended as {header.end_reason}, although the ball crossed the landing plane"
    elif header.end_reason == "landed" and not len(crossings):
        yield (
            "ended as landed, but its last samples do not enclose a crossing of the landing plane out of the "
            f"{config.tool.name}"
        )
    if header.end_reason == "timeout" and last < most:
        yield f"ended as timeout after {last + 1} samples; the longest trial has {most + 1}"
    if header.end_reason == "rest" and (problem := _explain_unrest(trial)):
        yield f"ended as rest, but {problem}"


def _explain_unrest(trial: RecordedTrial) -> str | None:
    """Say why a trial cannot have ended as `rest`; None if it can have."""
    physics_hz = trial.config.sim.physics_hz
    since = trial.last_step - REST_S * physics_hz
    resting = np.arange(0, trial.last_step + 1, trial.stride) > since
    speed = float(np.linalg.norm(trial.samples.ball_linear_velocity[resting], axis=1).max())
    if speed > REST_SPEED_MPS + _ROUNDING:
        return f"the ball moved at {speed:.3g} m/s in the last {REST_S} s"
    if not trial.find_pressed(trial.header.contacts)[resting].all():
        return f"nothing held the ball in the last {REST_S} s"
    moves_s = trial.motion_s + trial.config.sim.command_delay_s
    # A goal that was given up ends the motion at another time.
    if not trial.has_failed_goal and since / physics_hz < moves_s - 1 / physics_hz:
        return f"the arm moved until {moves_s:.3f} s, less than {REST_S} s before"
    return None
