"""The result of a throw: its outcome and its measures."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.tasks.result import Outcome, Result
from throwcollect.tasks.result_columns import BodyColumns, Count, Number, ObjectState, SpinColumns, Vector, measured


class ThrowOutcome(Outcome):
    """How a throw ended."""

    LANDED = "landed"
    """The ball was thrown, and crossed the landing plane without touching the robot; all limits were kept."""
    NOT_RELEASED = "not_released"
    """The ball never left the tool for good."""
    DROPPED = "dropped"
    """The ball left the tool by its own weight: the tool did not throw it, or had lost it before the start."""
    RECAUGHT = "recaught"
    """The tool touched the ball again after its release."""
    SELF_HIT = "self_hit"
    """The ball touched a link of the robot after its release."""
    BODY_HIT = "body_hit"
    """The ball touched a body of the scene before it landed."""
    LIMIT_VIOLATED = "limit_violated"
    """The ball landed, but a joint left its position or velocity limits or saturated its effort."""
    TIMEOUT = "timeout"
    """The ball was released, but did not cross the landing plane in time."""
    # These end trials of every task.
    TRACKING_FAILED = "tracking_failed"
    LOST = "lost"


@dataclass(frozen=True)
class ThrowResult(Result):
    """Outcome and measures of a throw; the columns say what each measure is.

    The apex lies between the release and the landing, or the end of the record if there is no landing. The ball lands
    when its lowest point crosses the landing plane. See `flight.flight_residual` for `ballistic_residual_m`.
    """

    release: ObjectState | None = measured(BodyColumns("when it left the {tool}"))
    apex: ObjectState | None = measured(BodyColumns("at the highest point of its flight"))
    landing: ObjectState | None = measured(BodyColumns("when it crossed the landing plane"))
    release_speed_mps: float | None = measured(Number("Speed at release [m/s]."))
    release_elevation_rad: float | None = measured(Number("Direction of flight at release above the horizontal [rad]."))
    flight_time_s: float | None = measured(Number("From release to landing [s]."))
    hit_angle_rad: float | None = measured(Number("Direction of flight at landing below the horizontal [rad]."))
    recontacts: int | None = measured(Count("Contacts with {tool} or robot between release and landing."))
    release_spin: Vector | None = measured(SpinColumns("when it left the {tool}"))
    ballistic_residual_m: float | None = measured(
        Number("Largest distance of the flight from one under gravity and drag alone [m].")
    )
