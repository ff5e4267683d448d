"""Keys of the task `throw`."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Angle, Joint
from throwcollect.config.task_config import TargetColumn, TaskConfig, UntilConfig, Wanted, target_place


class UntilLanded(UntilConfig):
    """When enough has been collected."""

    landed: Wanted
    """Number of throws that should land: the last of them is the last trial of the dataset."""


class SwingConfig(TaskConfig):
    """Keys of every task that throws: the arm swings from `start` to `end`, and the spoon brakes."""

    until: ClassVar[type[UntilConfig]] = UntilLanded
    tool_acts: ClassVar[bool] = True
    noun: ClassVar[str] = "throw"
    keyword: ClassVar[str] = "throwing"
    instruction: ClassVar[str] = "Throw the ball"
    events: ClassVar[tuple[str, ...]] = ("release", "apex", "landing")
    targets: ClassVar[tuple[str, ...]] = ("landing_x_m", "landing_y_m")

    name: str
    """Task."""
    start: Annotated[dict[Joint, Angle], Key(Effect.PHYSICS, swept=True)] = {
        "torso_1_joint": 0.0,
        "arm_right_1_joint": 1.5,
        "arm_right_2_joint": -2.6,
        "arm_right_3_joint": -1.57,
        "arm_right_4_joint": -1.9,
        "arm_right_5_joint": 0.0,
        "arm_right_6_joint": 0.0,
        "arm_right_7_joint": -0.1,
    }
    """Joint angles at the start of each trial; the spoon must hold the ball, or the trial is refused."""
    end: Annotated[dict[Joint, Angle], Key(swept=True)] = {
        "torso_1_joint": 0.0,
        "arm_right_1_joint": 1.5,
        "arm_right_2_joint": -2.6,
        "arm_right_4_joint": -0.5,
        "arm_right_7_joint": 0.5,
    }
    """Joint angles at the end of the motion. The joints named here are the moving ones, even if end equals start.
    One of them must move the spoon."""
    recatch_gap_s: Annotated[float, Field(ge=0, le=1)] = 0.02
    """The ball counts as released when it has been out of the spoon for this long."""


class ThrowConfig(SwingConfig):
    """The task `throw`: the arm swings from `start` to `end`; the ball leaves the spoon when the spoon brakes."""

    implementation: ClassVar[str] = "throwcollect.tasks.throw.throw_task:ThrowTask"
    given: ClassVar[tuple[str, ...]] = ("scene.landing_height_m",)
    target_columns: ClassVar[tuple[TargetColumn, ...]] = (
        *target_place("landing", "Where the ball should land"),
        TargetColumn(
            "target_z_m", "scene.landing_height_m", "miss_m", "z", "Height at which the ball should land [m]."
        ),
        TargetColumn(
            "target_hit_angle_rad",
            "hit_angle_rad",
            "miss_hit_angle_rad",
            "hit angle",
            "Direction of flight below the horizontal with which the ball should land [rad].",
        ),
    )

    name: Literal["throw"] = "throw"
    """Task."""
