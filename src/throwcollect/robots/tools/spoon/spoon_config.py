"""Keys of the throwing spoon."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Key
from throwcollect.config.tool_config import ToolConfig


class SpoonConfig(ToolConfig):
    """The throwing spoon: a handle and a cone of thin walls, fixed to the robot's hand."""

    implementation: ClassVar[str] = "throwcollect.robots.tools.spoon.spoon:Spoon"

    name: Literal["spoon"] = "spoon"
    """Tool model."""
    handle_length_m: Annotated[float, Field(ge=0.05, le=0.5), Key(swept=True)] = 0.15
    """Length of the handle, along -z of the hand's link."""
    handle_width_m: Annotated[float, Field(ge=0.004, le=0.05)] = 0.012
    """Width and thickness of the handle."""
    mount_offset_m: Annotated[float, Field(ge=0.0, le=0.3), Key(swept=True)] = 0.10
    """Distance from the hand's link to the handle's upper end."""
    cup_walls: Annotated[int, Field(ge=4, le=24)] = 6
    """Number of flat walls that form the cone; each costs about 5 µs a step."""
    cup_floor_radius_m: Annotated[float, Field(gt=0, le=0.05)] = 0.004
    """Radius of the cone at its bottom."""
    cup_rim_radius_m: Annotated[float, Field(gt=0, le=0.2)] = 0.045
    """Radius of the cone at its rim."""
    cup_depth_m: Annotated[float, Field(gt=0, le=0.2)] = 0.032
    """Depth of the cone."""
    wall_thickness_m: Annotated[float, Field(gt=0, le=0.02)] = 0.004
    """Thickness of the cone's walls."""
    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.12
    """Mass of the whole spoon."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.cup_rim_radius_m <= self.cup_floor_radius_m:
            floor = f"cup_floor_radius_m, {self.cup_floor_radius_m} m"
            yield "cup_rim_radius_m", f"{self.cup_rim_radius_m} m should be above {floor}, or the cup holds no ball"
