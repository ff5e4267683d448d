"""Checks the header of an episode against its samples: contacts, goals, and why the trial ended."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.robots.talos import CONTROLLERS, controller_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.flight import NS_PER_S

_END_REASONS = ("landed", "rest", "timeout")
_REST_S = 0.5
_REST_SPEED = 0.01
"""The simulation ends a trial as `rest` when the ball has been slower than this [m/s] for so long [s]."""
_EXECUTING, _SUCCEEDED, _CANCELED, _ABORTED = 2, 4, 5, 6
"""Of action_msgs/msg/GoalStatus."""
_LEAST_ERROR_CODE = -5
"""Of control_msgs/action/FollowJointTrajectory; 0 is success."""
_ROUNDING = 1e-9
_short = reprlib.Repr()
_short.maxstring = 60


class Steps:
    """The physics steps of a trial, and which of them an instant is.

    Attributes:
        stride: Physics steps from one sample to the next.
        last: The step of the last sample; the first sample is at step 0.

    Args:
        samples: The trial.
        header: Its header.
        config: Its configuration.
    """

    def __init__(self, samples: Samples, header: EpisodeHeader, config: Config) -> None:
        self.stride = config.sim.physics_hz // config.record.rate_hz
        self.last = self.stride * (len(samples) - 1)
        self._start_ns = header.start_ns
        self._hz = config.sim.physics_hz

    def at(self, instant_ns: int) -> int | None:
        """The step that ends at an instant [ns]; None if none of the trial does."""
        step = round((instant_ns - self._start_ns) * self._hz / NS_PER_S)
        on_step = self._start_ns + step * NS_PER_S // self._hz == instant_ns
        return step if on_step and 0 <= step <= self.last else None

    def of(self, contact: Contact) -> tuple[int, int] | None:
        """First step of a contact and the one after its last; None if it does not begin and end on steps, in order."""
        begin = self.at(contact.start_ns)
        end = self.last + 1 if contact.end_ns is None else self.at(contact.end_ns)
        return None if begin is None or end is None or end <= begin else (begin, end)

    def pressed(self, contacts: Collection[Contact]) -> NDArray[np.bool_]:
        """At which samples at least one of these contacts lasts, shape ``(n_samples,)``."""
        steps = np.arange(0, self.last + 1, self.stride)
        pressed = np.zeros(len(steps), dtype=bool)
        for interval in map(self.of, contacts):
            if interval is not None:
                pressed |= (steps >= interval[0]) & (steps < interval[1])
        return pressed


def header_problems(
    samples: Samples, header: EpisodeHeader, *, config: Config, trajectory: JointTrajectory, bodies: Collection[str]
) -> Iterator[str]:
    """What a header says that cannot be, or that its samples contradict.

    Args:
        samples: The trial; finite, with the stamps that belong to it.
        header: Its header.
        config: Its configuration.
        trajectory: What its controllers were sent.
        bodies: Names of all bodies that can touch the ball.

    Yields:
        What is wrong, a sentence each.
    """
    steps = Steps(samples, header, config)
    yield from _contact_problems(header, steps, bodies)
    yield from _goal_problems(samples, header, trajectory)
    if header.end_reason not in _END_REASONS:
        yield f"ended as {_short.repr(header.end_reason)}, not as {', '.join(_END_REASONS)}"
    else:
        yield from _end_problems(samples, header, steps, config, trajectory)


def _contact_problems(header: EpisodeHeader, steps: Steps, bodies: Collection[str]) -> Iterator[str]:
    order = [(contact.start_ns, contact.body) for contact in header.contacts]
    if order != sorted(order):
        yield "the contacts are not in order of their starts"
    ends: dict[str, int] = {}
    for contact in header.contacts:
        what = contact_name(contact, header)
        if contact.body not in bodies:
            yield f"{what}: no such body can touch the ball"
        interval = steps.of(contact)
        if interval is None:
            yield f"{what} to {contact.end_ns} ns does not begin and end, in this order, on physics steps of the trial"
        else:
            if interval[0] <= ends.get(contact.body, -1):
                yield f"{what} begins before the one before it has ended"
            ends[contact.body] = interval[1]


def _goal_problems(samples: Samples, header: EpisodeHeader, trajectory: JointTrajectory) -> Iterator[str]:
    sent = {controller_of(joint) for joint in trajectory.joints}
    expected = [name for name in CONTROLLERS if name in sent]
    found = [goal.controller for goal in header.goals]
    if found != expected:
        yield f"has goals of {_short.repr(found)}, the trajectory is sent to {expected}"
    duration_s = float(samples.stamps_ns[-1] - samples.stamps_ns[0]) / NS_PER_S
    for goal in header.goals:
        what = f"the goal of {_short.repr(goal.controller)}"
        if goal.status not in (_EXECUTING, _SUCCEEDED, _CANCELED, _ABORTED):
            yield f"{what} has the unknown status {goal.status}"
        if not _LEAST_ERROR_CODE <= goal.error_code <= 0:
            yield f"{what} has the unknown error code {goal.error_code}"
        if goal.status in (_EXECUTING, _SUCCEEDED) and goal.error_code:
            yield f"{what} has status {goal.status} and an error code all the same"
        if goal.status == _SUCCEEDED and duration_s < trajectory.times[-1] - _ROUNDING:
            yield f"{what} succeeded, but the trial ended at {duration_s:.3f} s, before its trajectory"


def _end_problems(
    samples: Samples, header: EpisodeHeader, steps: Steps, config: Config, trajectory: JointTrajectory
) -> Iterator[str]:
    last = len(samples) - 1
    most = math.ceil(math.ceil(config.sim.max_trial_s * config.sim.physics_hz) / steps.stride)
    if last > most:
        yield f"has {last + 1} samples; the longest trial has {most + 1}"
    height = samples.ball_position[:, 2] - config.scene.landing_height_m - config.ball.radius_m
    held = steps.pressed([contact for contact in header.contacts if contact.body == "spoon"])
    crossings = np.flatnonzero((height[1:] < 0) & (height[:-1] >= 0) & ~held[1:]) + 1
    if len(crossings) and crossings[0] < last:
        crossed = _seconds(int(samples.stamps_ns[crossings[0]]), header)
        yield f"the ball crossed the landing plane at {crossed}, and the trial went on"
    elif len(crossings) and header.end_reason != "landed":
        yield f"ended as {header.end_reason}, although the ball crossed the landing plane"
    elif header.end_reason == "landed" and not len(crossings):
        yield "ended as landed, but its last samples do not enclose a crossing of the landing plane out of the spoon"
    if header.end_reason == "timeout" and last < most:
        yield f"ended as timeout after {last + 1} samples; the longest trial has {most + 1}"
    if header.end_reason == "rest" and (problem := _unrest(samples, header, steps, config, trajectory)):
        yield f"ended as rest, but {problem}"


def _unrest(
    samples: Samples, header: EpisodeHeader, steps: Steps, config: Config, trajectory: JointTrajectory
) -> str | None:
    """Why a trial cannot have ended as `rest`; None if nothing is against it."""
    since = steps.last - _REST_S * config.sim.physics_hz
    resting = np.arange(0, steps.last + 1, steps.stride) > since
    speed = float(np.linalg.norm(samples.ball_linear_velocity[resting], axis=1).max())
    if speed > _REST_SPEED + _ROUNDING:
        return f"the ball moved at {speed:.3g} m/s in the last {_REST_S} s"
    if not steps.pressed(header.contacts)[resting].all():
        return f"nothing held the ball in the last {_REST_S} s"
    moves_s = float(trajectory.times[-1]) + config.sim.command_delay_s
    # A goal that was given up ends the motion at another time.
    given_up = any(goal.status in (_CANCELED, _ABORTED) for goal in header.goals)
    if not given_up and since / config.sim.physics_hz < moves_s - 1 / config.sim.physics_hz:
        return f"the arm moved until {moves_s:.3f} s, less than {_REST_S} s before"
    return None


def contact_name(contact: Contact, header: EpisodeHeader) -> str:
    """A contact in words, however long the name of its body is."""
    return f"the contact with {_short.repr(contact.body)} at {_seconds(contact.start_ns, header)}"


def _seconds(instant_ns: int, header: EpisodeHeader) -> str:
    """An instant as time since the start of the trial, in words."""
    return f"{(instant_ns - header.start_ns) / NS_PER_S:.3f} s"
