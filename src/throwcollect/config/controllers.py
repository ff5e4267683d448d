"""Keys by which the joint trajectory controllers may be made to differ from those of ros2_controllers."""

from typing import Annotated, Literal

from pydantic import Field

from throwcollect.config.section import Section


class ControllersConfig(Section):
    """The joint trajectory controllers; by default they do what clients of PAL's robot and ros2_controllers expect."""

    hold: Literal["measured", "command", "decelerate"] = "measured"
    """What joints do when a goal is cancelled or aborted: they are held at the `measured` positions (ros2_controllers);
    at the last `command`, so that joints which lag under load do not sag; or they `decelerate` to rest. This needs
    measured velocities, so feedback has them, too (constraints.decelerate_on_cancel of ros2_controllers)."""
    max_deceleration_radps2: Annotated[float, Field(gt=0, le=1000)] = 10.0
    """How hard each joint brakes with `hold: decelerate`."""
    topic_aborts_goal: bool = False
    """Whether a trajectory on a controller's topic aborts the goal of its action; otherwise the goal stays open and is
    judged on that trajectory (ros2_controllers)."""
    refused_goals: Literal["reject", "abort"] = "reject"
    """How goals that cannot be executed are answered: they are rejected, and only the log has the reason
    (ros2_controllers); or they are accepted and aborted at once, with error code and reason in the result."""
