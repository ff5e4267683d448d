"""Keys of the task `throw_into`."""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.scene import AnyBody, BoxConfig
from throwcollect.config.section import Section
from throwcollect.config.task_config import TargetColumn, UntilConfig, Wanted
from throwcollect.tasks.throw.throw_config import SwingConfig, ThrowConfig

_Place = Annotated[float, Field(ge=-20, le=20)]
_Length = Annotated[float, Field(ge=0.005, le=10)]


class UntilInBin(UntilConfig):
    """When enough has been collected."""

    in_bin: Wanted
    """Number of throws that should end in the bin: the last of them is the last trial of the dataset."""


class BinConfig(Section):
    """A bin that is open at the top, on the ground or at a height."""

    x_m: _Place = 1.6
    """Middle of its opening in world: x."""
    y_m: _Place = -0.25
    """Middle of its opening in world: y."""
    height_m: Annotated[float, Field(ge=0, le=5)] = 0.0
    """Height of its underside above the ground."""
    depth_m: Annotated[float, Field(ge=0, le=2)] = 0.25
    """Height of its rim above its underside; with 0, the bin is a mark on the ground, without floor and walls."""
    size_x_m: _Length = 0.4
    """Length of its opening along its own x, between the walls."""
    size_y_m: _Length = 0.4
    """Length of its opening along its own y, between the walls."""
    yaw_rad: Annotated[float, Field(ge=-math.pi, le=math.pi)] = 0.0
    """Turn about the vertical."""
    wall_m: Annotated[float, Field(ge=0.002, le=0.1)] = 0.01
    """Thickness of its floor and its walls."""
    friction: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Coulomb friction [-], which is multiplied with that of the ball."""
    restitution: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Coefficient of restitution [-], which is multiplied with that of the ball."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if 0 < self.depth_m < 2 * self.wall_m:
            yield "depth_m", f"should be 0, or at least twice wall_m, {self.wall_m:g}, got {self.depth_m:g}"
        if self.height_m and not self.depth_m:
            yield "height_m", "should be 0 if depth_m is 0, as a mark lies on the ground"

    @property
    def rim_height_m(self) -> float:
        """Height of the rim above the ground [m]."""
        return self.height_m + self.depth_m

    def to_own_axes(self, x: float, y: float) -> tuple[float, float]:
        """Turn a place in world [m] into a place from the middle, along the bin's own axes [m]."""
        along, across = x - self.x_m, y - self.y_m
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return cos * along + sin * across, cos * across - sin * along

    def is_over(self, x: float, y: float) -> bool:
        """Whether a place in world [m] lies in the opening, seen from above."""
        along, across = self.to_own_axes(x, y)
        return abs(along) <= self.size_x_m / 2 and abs(across) <= self.size_y_m / 2

    def holds(self, centre: tuple[float, float, float], radius_m: float) -> bool:
        """Whether a ball at a place in world [m] lies in the bin, or on its mark."""
        x, y, z = centre
        return self.is_over(x, y) and self.height_m <= z <= self.rim_height_m + radius_m

    def boxes(self) -> Iterator[tuple[str, AnyBody]]:
        """Make the boxes of its floor and its four walls; none for a mark on the ground."""
        if not self.depth_m:
            return
        wall, outer_x, outer_y = self.wall_m, self.size_x_m + 2 * self.wall_m, self.size_y_m + 2 * self.wall_m
        upright, middle = self.depth_m - wall, self.height_m + (self.depth_m + wall) / 2
        side_x, side_y = (self.size_x_m + wall) / 2, (self.size_y_m + wall) / 2
        yield "bin_floor", self._box((0.0, 0.0), self.height_m + wall / 2, [outer_x, outer_y, wall])
        yield "bin_front", self._box((-side_x, 0.0), middle, [wall, outer_y, upright])
        yield "bin_back", self._box((side_x, 0.0), middle, [wall, outer_y, upright])
        yield "bin_right", self._box((0.0, -side_y), middle, [self.size_x_m, wall, upright])
        yield "bin_left", self._box((0.0, side_y), middle, [self.size_x_m, wall, upright])

    def _box(self, own: tuple[float, float], z: float, size: list[float]) -> BoxConfig:
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = self.x_m + cos * own[0] - sin * own[1], self.y_m + sin * own[0] + cos * own[1]
        return BoxConfig(
            shape="box",
            size_m=size,
            position_m=[x, y, z],
            rpy_rad=[0.0, 0.0, self.yaw_rad],
            friction=self.friction,
            restitution=self.restitution,
        )


class WallConfig(Section):
    """A wall across the world's x, over which the ball has to fly."""

    x_m: _Place = 1.1
    """Middle of its thickness in world: x."""
    y_m: _Place = 0.0
    """Middle of its width in world: y."""
    height_m: Annotated[float, Field(ge=0.01, le=5)] = 0.8
    """Height of its upper edge above the ground."""
    width_m: _Length = 2.0
    """Length along y."""
    thickness_m: Annotated[float, Field(ge=0.005, le=2)] = 0.02
    """Length along x."""

    def box(self) -> AnyBody:
        """Make the wall."""
        size = [self.thickness_m, self.width_m, self.height_m]
        return BoxConfig(shape="box", size_m=size, position_m=[self.x_m, self.y_m, self.height_m / 2], color="#7a7f87")


class ThrowIntoConfig(SwingConfig):
    """The task `throw_into`: as `throw`, and the ball should come to rest in a bin."""

    implementation: ClassVar[str] = "throwcollect.tasks.throw_into.into_task:ThrowIntoTask"
    until: ClassVar[type[UntilConfig]] = UntilInBin
    given: ClassVar[tuple[str, ...]] = ("task.bin.x_m", "task.bin.y_m", "task.bin.height_m", "task.bin.depth_m")
    informative: ClassVar[tuple[str, ...]] = ("short", "beyond", "bounced_out")
    target_columns: ClassVar[tuple[TargetColumn, ...]] = tuple(
        each for each in ThrowConfig.target_columns if each.name != "target_z_m"
    )

    name: Literal["throw_into"] = "throw_into"
    """Task."""
    bin: Annotated[BinConfig, Key(Effect.PHYSICS, swept=True)] = BinConfig()
    """The bin."""
    wall: Annotated[WallConfig | None, Key(Effect.PHYSICS, swept=True)] = None
    """A wall in front of the bin; null for none."""

    @property
    def bodies(self) -> Mapping[str, AnyBody]:
        """The parts of the bin, and the wall."""
        return {**dict(self.bin.boxes()), **({"wall": self.wall.box()} if self.wall is not None else {})}
