"""The result of a throw into a bin: its outcome and its measures."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.tasks.result import Outcome
from throwcollect.tasks.result_columns import BodyColumns, Count, Number, ObjectState, measured
from throwcollect.tasks.throw.throw_result import ThrowResult


class IntoOutcome(Outcome):
    """How a throw into a bin ended."""

    IN_BIN = "in_bin"
    """The ball came to rest in the bin, or landed on its mark; all limits were kept."""
    BOUNCED_OUT = "bounced_out"
    """The ball flew into the opening, and left the bin again."""
    RIM_HIT = "rim_hit"
    """The ball touched a wall of the bin from outside, or its rim, and did not stay in the bin."""
    WALL_HIT = "wall_hit"
    """The ball touched the wall in front of the bin first, and did not stay in the bin."""
    BODY_HIT = "body_hit"
    """The ball touched another body of the scene first, and did not stay in the bin."""
    SHORT = "short"
    """The ball came down to the height of the rim on this side of the middle of the bin."""
    BEYOND = "beyond"
    """The ball came down to the height of the rim beyond the middle of the bin, or to one side of it."""
    # These are as in `ThrowOutcome`.
    NOT_RELEASED = "not_released"
    DROPPED = "dropped"
    RECAUGHT = "recaught"
    SELF_HIT = "self_hit"
    LIMIT_VIOLATED = "limit_violated"
    """The ball stayed in the bin, but a joint left its position or velocity limits or saturated its effort."""
    TIMEOUT = "timeout"
    """The ball was released, but neither missed the bin nor came to rest in it in time."""
    # These end trials of every task.
    TRACKING_FAILED = "tracking_failed"
    LOST = "lost"


@dataclass(frozen=True)
class IntoResult(ThrowResult):
    """Outcome and measures of a throw into a bin; the landing is where the ball comes down to the height of the rim."""

    rest: ObjectState | None = measured(BodyColumns("at the end of the trial, if it rests"))
    bin_miss_m: float | None = measured(
        Number("Horizontal distance of the landing, at the height of the rim, from the middle of the bin [m].")
    )
    wall_clearance_m: float | None = measured(
        Number("Height of the ball's lowest point over the wall's upper edge when its centre passes the wall [m].")
    )
    bounces: int | None = measured(Count("Contacts with ground and bodies after the release."))
