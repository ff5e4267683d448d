"""Where a controller may differ from ros2_controllers, for users who want it to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Deviations:
    """Departures from upstream that a client can notice; the defaults are upstream's behaviour.

    Attributes:
        hold: What joints are held at when a goal is cancelled or aborted: the measured positions or, so that joints
            which lag under load do not sag, the last command.
        topic_aborts_goal: Whether a trajectory from the topic aborts the goal that is being executed, which otherwise
            is judged on that trajectory.
    """

    hold: Literal["measured", "command"] = "measured"
    topic_aborts_goal: bool = False
