"""Keys of the paddle."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Key
from throwcollect.config.tool_config import ToolConfig


class PaddleConfig(ToolConfig):
    """The paddle: a handle and a flat blade, fixed to the robot's hand; it holds nothing, and hits with its faces."""

    implementation: ClassVar[str] = "throwcollect.robots.tools.paddle.paddle:Paddle"

    name: Literal["paddle"] = "paddle"
    """Tool model."""
    mount_offset_m: Annotated[float, Field(ge=0.0, le=0.3), Key(swept=True)] = 0.10
    """Distance from the hand's link to the handle's upper end."""
    handle_length_m: Annotated[float, Field(ge=0.01, le=1)] = 0.12
    """Length of the handle, along -z of the hand's link."""
    handle_width_m: Annotated[float, Field(ge=0.004, le=0.05)] = 0.02
    """Width and thickness of the handle."""
    blade_length_m: Annotated[float, Field(ge=0.01, le=0.5)] = 0.12
    """Length of the blade, along the handle."""
    blade_width_m: Annotated[float, Field(ge=0.01, le=0.5)] = 0.16
    """Width of the blade, along y of the hand's link."""
    blade_thickness_m: Annotated[float, Field(ge=0.004, le=0.05)] = 0.01
    """Thickness of the blade, along x, in which the arm swings."""
    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.2
    """Mass of the paddle."""
