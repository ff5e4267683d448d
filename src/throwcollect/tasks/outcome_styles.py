"""How outcomes are drawn: in the same colours on the page, in reports, in pictures and in viewers."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from throwcollect.tasks.result import LIMIT_VIOLATED, LOST, REFUSED, TRACKING_FAILED
from throwcollect.tasks.slide.slide_result import SlideOutcome
from throwcollect.tasks.throw.throw_result import ThrowOutcome
from throwcollect.tasks.throw_into.into_result import IntoOutcome


@dataclass(frozen=True)
class Style:
    """How an outcome is drawn.

    Attributes:
        colour: In hex; people who confuse red and green tell these colours apart, on white and on black.
        symbol: Marker, as plotly calls it.
    """

    colour: str
    symbol: str


LANDED = ThrowOutcome.LANDED.value
STYLES = MappingProxyType(
    {
        LANDED: Style("#0072B2", "circle"),
        LIMIT_VIOLATED: Style("#E69F00", "diamond"),
        ThrowOutcome.SELF_HIT.value: Style("#D55E00", "x"),
        ThrowOutcome.RECAUGHT.value: Style("#CC79A7", "triangle-up"),
        ThrowOutcome.NOT_RELEASED.value: Style("#56B4E9", "square"),
        ThrowOutcome.DROPPED.value: Style("#8A63D2", "star-triangle-down"),
        ThrowOutcome.BODY_HIT.value: Style("#44AA99", "hourglass"),
        IntoOutcome.WALL_HIT.value: Style("#AA4499", "diamond-wide"),
        IntoOutcome.RIM_HIT.value: Style("#00A2B3", "diamond-tall"),
        IntoOutcome.BOUNCED_OUT.value: Style("#CC6677", "bowtie"),
        IntoOutcome.SHORT.value: Style("#C4B04A", "triangle-left"),
        IntoOutcome.BEYOND.value: Style("#117733", "triangle-right"),
        SlideOutcome.MISSED_PUCK.value: Style("#56B4E9", "circle-open"),
        SlideOutcome.PUSHED_TWICE.value: Style("#CC79A7", "triangle-ne"),
        SlideOutcome.OFF_TABLE.value: Style("#8A63D2", "triangle-se"),
        SlideOutcome.ROBOT_HIT.value: Style("#D55E00", "x-thin-open"),
        ThrowOutcome.TIMEOUT.value: Style("#009E73", "triangle-down"),
        TRACKING_FAILED: Style("#999933", "cross"),
        LOST: Style("#7F7F7F", "hexagon"),
        REFUSED: Style("#B3B3B3", "star"),
    }
)
_COLOURS = ("#882255", "#A0522D", "#4A90D9", "#B04AC0", "#7F9C1F", "#1F9E77")
_SYMBOLS = ("pentagon", "octagon", "hexagram", "star-square", "star-diamond")
"""Those of outcomes that only tasks of other packages have."""


def style_of(outcome: str, success: str = LANDED) -> Style:
    """How an outcome is drawn; the success of any task is drawn as a landing is."""
    # What draws an outcome may not know which others there are, so the name alone chooses.
    number = sum(map(ord, outcome))
    other = Style(_COLOURS[number % len(_COLOURS)], _SYMBOLS[number % len(_SYMBOLS)])
    return STYLES.get(LANDED if outcome == success else outcome, other)
