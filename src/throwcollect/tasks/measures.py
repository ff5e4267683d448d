"""Parts of results that are more than a number: the object at one instant, and the joint closest to its limit."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class ObjectState:
    """The object at one instant; world frame.

    Attributes:
        time_s: Time since the start of the trial [s].
        position: Its centre [m].
        velocity: Its velocity [m/s].
    """

    time_s: float
    position: Vector
    velocity: Vector


@dataclass(frozen=True)
class Peak:
    """Largest value of one quantity, of all joints during a trial.

    Attributes:
        joint: Joint that had the value.
        share: Value over limit [-]; 1 is at the limit.
    """

    joint: str
    share: float
