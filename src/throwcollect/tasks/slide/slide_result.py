"""The result of a slide: its outcome and its measures."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.tasks.result import Outcome, Result
from throwcollect.tasks.result_columns import BodyColumns, Count, Number, ObjectState, measured


class SlideOutcome(Outcome):
    """How a slide ended."""

    AT_REST = "at_rest"
    """The tool pushed the puck once, and it came to rest on the table; all limits were kept."""
    MISSED_PUCK = "missed_puck"
    """The tool never touched the puck."""
    PUSHED_TWICE = "pushed_twice"
    """The tool touched the puck again after it had left."""
    OFF_TABLE = "off_table"
    """The puck fell from the table."""
    ROBOT_HIT = "robot_hit"
    """The puck touched a link of the robot."""
    LIMIT_VIOLATED = "limit_violated"
    """The puck came to rest, but a joint left its position or velocity limits or saturated its effort."""
    TIMEOUT = "timeout"
    """The puck or the arm did not come to rest in time."""
    # These end trials of every task.
    TRACKING_FAILED = "tracking_failed"
    LOST = "lost"


@dataclass(frozen=True)
class SlideResult(Result):
    """Outcome and measures of a slide; the columns say what each measure is."""

    hit: ObjectState | None = measured(BodyColumns("when the {tool} first touched it"))
    leave: ObjectState | None = measured(BodyColumns("when the {tool} last lost contact with it"))
    rest: ObjectState | None = measured(BodyColumns("at the end of the trial, if it rests on the table"))
    rest_yaw_rad: float | None = measured(Number("Turn of the resting puck about the vertical since the start [rad]."))
    puck_speed_mps: float | None = measured(Number("Horizontal speed when it left the {tool} [m/s]."))
    slide_distance_m: float | None = measured(Number("Horizontal distance from where it left to where it rests [m]."))
    pushes: int | None = measured(Count("Pushes by the {tool}: contacts with little time in between are one push."))
