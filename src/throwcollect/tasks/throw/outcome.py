"""What a throw amounted to, as numbers and a word."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Outcome(str, Enum):
    """How a trial ended."""

    LANDED = "landed"
    """Thrown, and crossed the landing plane without touching the robot, within all limits."""
    NOT_RELEASED = "not_released"
    """The ball never left the spoon for good."""
    DROPPED = "dropped"
    """The ball left the spoon by its own weight: the spoon did not throw it, or had lost it before the start."""
    RECAUGHT = "recaught"
    """The spoon touched the ball again after its release."""
    SELF_HIT = "self_hit"
    """The ball touched a link of the robot after its release."""
    LIMIT_VIOLATED = "limit_violated"
    """Landed, but a joint left its position or velocity limits or saturated its effort."""
    TIMEOUT = "timeout"
    """Released, but it did not cross the landing plane in time."""
    TRACKING_FAILED = "tracking_failed"
    """A controller did not carry out its trajectory, or the simulation diverged."""
    LOST = "lost"
    """No simulation returned an episode."""


@dataclass(frozen=True)
class BallState:
    """The ball at one instant; world frame.

    Attributes:
        time_s: Time since the start of the trial [s].
        position: Centre [m].
        velocity: [m/s].
    """

    time_s: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


@dataclass(frozen=True)
class Peak:
    """Largest value of a kind during a trial.

    Attributes:
        joint: Joint that had it.
        share: Value over limit [-]; 1 is at the limit.
    """

    joint: str
    share: float


@dataclass(frozen=True)
class ThrowResult:
    """Outcome and key numbers of a trial; None where there is nothing to measure.

    Attributes:
        outcome: How the trial ended.
        reason: One sentence on why the throw did not simply land; None if it did.
        release: The ball when it left the spoon.
        apex: The ball at the highest point between release and landing (or the end of the record).
        landing: The ball when its lowest point crossed the landing plane.
        release_speed_mps: Speed at release [m/s].
        release_elevation_rad: Direction of flight at release above the horizontal [rad].
        flight_time_s: From release to landing [s].
        hit_angle_rad: Direction of flight at landing below the horizontal [rad].
        recontacts: Number of contacts with spoon or robot between release and landing.
        position_peak: Of the moving joints: distance from the middle of the range over half the range.
        velocity_peak: Of all joints: speed over its limit.
        effort_peak: Of all joints: torque over its limit.
        effort_saturated_share: Share of samples in which some joint's torque is at its limit [-].
        tracking_error_rad: Of each moving joint: largest distance from the commanded trajectory [rad].
    """

    outcome: Outcome
    reason: str | None = None
    release: BallState | None = None
    apex: BallState | None = None
    landing: BallState | None = None
    release_speed_mps: float | None = None
    release_elevation_rad: float | None = None
    flight_time_s: float | None = None
    hit_angle_rad: float | None = None
    recontacts: int | None = None
    position_peak: Peak | None = None
    velocity_peak: Peak | None = None
    effort_peak: Peak | None = None
    effort_saturated_share: float | None = None
    tracking_error_rad: Mapping[str, float] | None = None
