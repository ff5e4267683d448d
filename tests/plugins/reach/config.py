"""Keys of the task `reach`."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Angle, Joint
from throwcollect.config.task_config import TaskConfig, UntilConfig, Wanted


class UntilReached(UntilConfig):
    """When enough has been collected."""

    reached: Wanted
    """Number of motions that should reach their end: the last of them is the last trial of the dataset."""


class ReachConfig(TaskConfig):
    """The task `reach`: the arm moves from `start` to `end`, and keeps the ball."""

    implementation: ClassVar[str] = "reach.reach_task:ReachTask"
    until: ClassVar[type[UntilConfig]] = UntilReached

    name: Literal["reach"] = "reach"
    """Task."""
    start: Annotated[dict[Joint, Angle], Key(Effect.PHYSICS, swept=True)] = {
        "torso_1_joint": 0.0,
        "arm_right_1_joint": 1.5,
        "arm_right_2_joint": -2.6,
        "arm_right_3_joint": -1.57,
        "arm_right_4_joint": -1.9,
    }
    """Joint angles at the start of each trial."""
    end: Annotated[dict[Joint, Angle], Key(swept=True)] = {"torso_1_joint": 0.2}
    """Joint angles at the end of the motion."""
    tolerance_rad: Annotated[float, Field(gt=0, le=1), Key(swept=True)] = 0.01
    """How far a joint may be from its end in the last sample."""
