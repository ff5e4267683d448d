"""The values that describe an episode, independent of any encoding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from throwcollect.units import NS_PER_S

Instant = Annotated[int, Field(ge=0, le=2**62)]
"""Simulated time [ns]; no clock shows later ones."""
_BODY_PARTS = (3, 7, 10)
"""Where orientation, linear and angular velocity of a body begin, behind its position."""
_Name = Annotated[str, Field(max_length=256)]
"""Name of a link or a controller; those of robots are far shorter."""


@dataclass(frozen=True)
class Samples:
    """Recorded samples of one trial, one row per sample, evenly spaced; world frame: x forward, y left, z up.

    Attributes:
        stamps_ns: Simulated time [ns], shape ``(n_samples,)``, int64.
        position: Joint positions [rad], shape ``(n_samples, n_joints)``, in the order of `Robot.joints`.
        velocity: Joint velocities [rad/s], shape ``(n_samples, n_joints)``.
        effort: Torques applied by the motors [Nm], shape ``(n_samples, n_joints)``; 0 for locked joints.
        object_position: Centre in world of the object that the robot acts on [m], shape ``(n_samples, 3)``.
        object_orientation_xyzw: Unit quaternion, object to world, shape ``(n_samples, 4)``.
        object_linear_velocity: In world [m/s], shape ``(n_samples, 3)``.
        object_angular_velocity: In world [rad/s], shape ``(n_samples, 3)``.
        bodies: The same four of each other body that moves, side by side, shape ``(n_samples, n_bodies, 13)``.
        command: Positions that a policy asked for, and those that were sent, which limits may have clipped, of the
            joints that it commands [rad], shape ``(n_samples, 2, n_commanded)``; none without a policy.
    """

    stamps_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    object_position: NDArray[np.float64]
    object_orientation_xyzw: NDArray[np.float64]
    object_linear_velocity: NDArray[np.float64]
    object_angular_velocity: NDArray[np.float64]
    bodies: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 13)))
    command: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2, 0)))

    def __post_init__(self) -> None:
        if len(self.bodies) != len(self):
            object.__setattr__(self, "bodies", np.zeros((len(self), 0, 13)))
        if len(self.command) != len(self):
            object.__setattr__(self, "command", np.zeros((len(self), 2, 0)))

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, rows: slice) -> Samples:
        return Samples(**{name: column[rows] for name, column in vars(self).items()})

    def parts_of(self, number: int) -> Sequence[NDArray[np.float64]]:
        """Position, orientation, linear and angular velocity of the object, number 0, or of another body that moves."""
        if number:
            return np.split(self.bodies[:, number - 1], _BODY_PARTS, axis=1)
        turn = self.object_orientation_xyzw
        return self.object_position, turn, self.object_linear_velocity, self.object_angular_velocity

    def seconds_since(self, instant_ns: int) -> NDArray[np.float64]:
        """Times of the samples, counted from an instant [s], shape ``(n_samples,)``."""
        times: NDArray[np.float64] = (self.stamps_ns - instant_ns) / NS_PER_S
        return times


@dataclass(frozen=True)
class ControllerSamples:
    """Set points of one joint trajectory controller, one row per sample, joints in the controller's order.

    Attributes:
        elapsed_ns: Time since the start of its trajectory [ns], shape ``(n_samples,)``, int64.
        position: Reference position [rad], shape ``(n_samples, n_joints)``.
        velocity: Reference velocity [rad/s], shape ``(n_samples, n_joints)``.
        acceleration: Reference acceleration [rad/s²], shape ``(n_samples, n_joints)``.
        output: Commanded position [rad], shape ``(n_samples, n_joints)``.
    """

    elapsed_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    output: NDArray[np.float64]


@dataclass(frozen=True)
class Contact:
    """An interval in which the object was pressed against one body (normal force above zero).

    Attributes:
        body: Name of the tool, ``ground``, or the name of the robot link or of the body of the scene.
        start_ns: Simulated time of the first physics step with force [ns].
        end_ns: Simulated time of the first physics step without [ns]; None when it lasted to the end.
    """

    body: Annotated[_Name, Field(min_length=1)]
    start_ns: Instant
    end_ns: Instant | None


@dataclass(frozen=True)
class GoalOutcome:
    """How the goal of one controller ended (control_msgs/action/FollowJointTrajectory).

    Attributes:
        controller: Name of the controller.
        status: Of action_msgs/msg/GoalStatus: 4 succeeded, 5 canceled, 6 aborted, 2 still executing at the end.
        error_code: Of the action's result.
        error_string: Of the action's result.
    """

    controller: _Name
    status: Annotated[int, Field(ge=0, le=6)]
    error_code: int
    error_string: Annotated[str, Field(max_length=10_000)]


EndReason = Literal["landed", "rest", "timeout"]
"""Reasons for the end of a trial: by the rule of its task; object and arm rest; its time is over."""
REST_S = 0.5
REST_SPEED_MPS = 0.01
"""An object rests that has been slower than this for so long."""


@dataclass(frozen=True)
class EpisodeHeader:
    """The facts of an episode besides its samples; `header_from_json` checks the bounds.

    Attributes:
        trial: Number of the trial.
        start_ns: Simulated time of the first sample [ns].
        end_reason: Reason for its end.
        contacts: All contacts of the object, by start time.
        goals: One entry per controller that had a goal.
        samples: Number of samples; the sequence numbers of message records can count up to this bound.
    """

    trial: Annotated[int, Field(ge=0)]
    start_ns: Instant
    end_reason: EndReason
    contacts: tuple[Contact, ...]
    goals: tuple[GoalOutcome, ...]
    samples: Annotated[int, Field(ge=1, le=2**32)]

    def seconds_at(self, instant_ns: int) -> float:
        """Time from the first sample to an instant [s]."""
        return (instant_ns - self.start_ns) / NS_PER_S


def find_infinite_columns(samples: Samples) -> Iterator[str]:
    """Find columns with numbers that are not finite, and make a sentence for each."""
    for each in fields(samples):
        finite = np.isfinite(getattr(samples, each.name))
        if not finite.all():
            # `argmin` finds the first False.
            row = int(np.argmin(finite.reshape(len(samples), -1).all(axis=1)))
            yield f"{each.name} holds numbers that are not finite, first in sample {row}"
