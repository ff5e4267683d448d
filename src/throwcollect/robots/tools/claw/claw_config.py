"""Keys of the claw."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field
from typing_extensions import Self

from throwcollect.config.key import Key
from throwcollect.config.tool_config import ToolConfig


class ClawConfig(ToolConfig):
    """The claw: a palm and two fingers, fixed to the robot's hand, which hold the ball until they let go of it."""

    implementation: ClassVar[str] = "throwcollect.robots.tools.claw.claw:Claw"

    name: Literal["claw"] = "claw"
    """Tool model."""
    release_s: Annotated[float, Field(gt=0, le=60), Key(swept=True)] = 0.7
    """Time since the start of the trial, and so of the motion, at which the fingers let go of the ball."""
    mount_offset_m: Annotated[float, Field(ge=0.0, le=0.3), Key(swept=True)] = 0.10
    """Distance from the hand's link to the palm's upper end."""
    palm_length_m: Annotated[float, Field(ge=0.01, le=0.5)] = 0.08
    """Length of the palm, along -z of the hand's link."""
    finger_length_m: Annotated[float, Field(ge=0.02, le=0.3)] = 0.08
    """Length of the fingers along +x, in which the arm swings; they hold the ball at their tips."""
    finger_width_m: Annotated[float, Field(ge=0.004, le=0.05)] = 0.012
    """Width and thickness of palm and fingers."""
    opening_m: Annotated[float, Field(gt=0, le=0.3)] = 0.10
    """Gap between the open fingers, in which the ball has to have room; the fingers are always drawn open."""
    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.25
    """Mass of the claw, without the ball."""

    def without_release(self) -> Self:
        """Make a copy with the same release as all other copies."""
        return self.model_copy(update={"release_s": 0.0})
