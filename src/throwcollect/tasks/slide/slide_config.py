"""Keys of the task `slide`."""

from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.scene import AnyBody, BoxConfig, CylinderConfig
from throwcollect.config.section import Angle, Joint, Section
from throwcollect.config.task_config import TargetColumn, TaskConfig, UntilConfig, Wanted, target_place

PUCK, TABLE = "puck", "table"
"""Names of the bodies of the task."""
_Place = Annotated[float, Field(ge=-20, le=20)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Friction = Annotated[float, Field(ge=0, le=2)]


class UntilAtRest(UntilConfig):
    """When enough has been collected."""

    at_rest: Wanted
    """Number of pucks that should come to rest: the last of them is that of the last trial of the dataset."""


class TableConfig(Section):
    """A table without legs, which never moves."""

    x_m: _Place = 1.2
    """Middle in world: x."""
    y_m: _Place = -0.5
    """Middle in world: y."""
    height_m: Annotated[float, Field(ge=0.01, le=3)] = 0.62
    """Height of its upper face above the ground."""
    size_x_m: Annotated[float, Field(ge=0.05, le=20)] = 1.6
    """Length along x."""
    size_y_m: Annotated[float, Field(ge=0.05, le=20)] = 1.0
    """Length along y."""
    thickness_m: Annotated[float, Field(ge=0.01, le=1)] = 0.04
    """Thickness."""
    friction: _Friction = 0.4
    """Coulomb friction [-], which is multiplied with that of the puck."""
    restitution: _Share = 1.0
    """Coefficient of restitution [-], which is multiplied with that of the puck."""

    @property
    def box(self) -> AnyBody:
        """The table as a body."""
        return BoxConfig(
            shape="box",
            size_m=[self.size_x_m, self.size_y_m, self.thickness_m],
            position_m=[self.x_m, self.y_m, self.height_m - self.thickness_m / 2],
            friction=self.friction,
            restitution=self.restitution,
        )


class PuckConfig(Section):
    """A flat cylinder, which lies on the table at the start."""

    x_m: _Place = 0.43
    """Its centre in world at the start: x."""
    y_m: _Place = -0.51
    """Its centre in world at the start: y."""
    radius_m: Annotated[float, Field(ge=0.005, le=0.5)] = 0.04
    """Radius."""
    height_m: Annotated[float, Field(ge=0.005, le=0.5)] = 0.04
    """Height."""
    mass_kg: Annotated[float, Field(gt=0, le=5)] = 0.08
    """Mass."""
    friction: _Friction = 0.5
    """Coulomb friction [-], which is multiplied with that of the table, and of the tool."""
    rolling_friction_m: Annotated[float, Field(ge=0, le=0.01)] = 0.0005
    """Lever arm with which the table resists its turning and tilting, over the friction of the table; without it, pucks
    at times wobble on for seconds with Bullet."""
    restitution: _Share = 0.0
    """Coefficient of restitution [-]; with 0, the tool pushes the puck until it brakes."""


class SlideConfig(TaskConfig):
    """The task `slide`: the arm swings from `start` to `end`; the tool pushes the puck, which slides on the table."""

    implementation: ClassVar[str] = "throwcollect.tasks.slide.slide_task:SlideTask"
    until: ClassVar[type[UntilConfig]] = UntilAtRest
    tool_acts: ClassVar[bool] = True
    tool: ClassVar[str] = "paddle"
    noun: ClassVar[str] = "slide"
    keyword: ClassVar[str] = "sliding"
    instruction: ClassVar[str] = "Push the puck"
    events: ClassVar[tuple[str, ...]] = ("hit", "leave", "rest")
    targets: ClassVar[tuple[str, ...]] = ("rest_x_m", "rest_y_m")
    given: ClassVar[tuple[str, ...]] = ("task.puck.x_m", "task.puck.y_m", "task.puck.mass_kg", "task.table.friction")
    target_columns: ClassVar[tuple[TargetColumn, ...]] = target_place("rest", "Where the puck should rest")

    name: Literal["slide"] = "slide"
    """Task."""
    start: Annotated[dict[Joint, Angle], Key(Effect.PHYSICS, swept=True)] = {
        "torso_1_joint": 0.29,
        "arm_right_1_joint": 0.137,
        "arm_right_2_joint": -1.413,
        "arm_right_3_joint": 1.532,
        "arm_right_4_joint": -1.189,
        "arm_right_5_joint": 1.011,
        "arm_right_6_joint": -0.304,
        "arm_right_7_joint": 0.066,
    }
    """Joint angles at the start of each trial; the tool must be clear of the table."""
    end: Annotated[dict[Joint, Angle], Key(swept=True)] = {
        "torso_1_joint": 0.29,
        "arm_right_1_joint": 0.807,
        "arm_right_4_joint": -0.834,
    }
    """Joint angles at the end of the motion. The joints named here are the moving ones, even if end equals start.
    One of them must move the tool."""
    duration_s: Annotated[float, Field(ge=0.1, le=10), Key(swept=True)] = 0.65
    """Duration of the motion (tau of a DMP)."""
    push_gap_s: Annotated[float, Field(ge=0, le=1)] = 0.1
    """Contacts of tool and puck with less time in between are one push."""
    table: Annotated[TableConfig, Key(Effect.PHYSICS, swept=True)] = TableConfig()
    """The table."""
    puck: Annotated[PuckConfig, Key(Effect.PHYSICS, swept=True)] = PuckConfig()
    """The puck, which is the object that the robot acts on."""

    @property
    def bodies(self) -> Mapping[str, AnyBody]:
        """The table, and the puck on it."""
        table, puck = self.table, self.puck
        cylinder = CylinderConfig(
            shape="cylinder",
            radius_m=puck.radius_m,
            length_m=puck.height_m,
            lies_on=TABLE,
            position_m=[puck.x_m - table.x_m, puck.y_m - table.y_m, 0.0],
            mass_kg=puck.mass_kg,
            friction=puck.friction,
            rolling_friction_m=puck.rolling_friction_m,
            restitution=puck.restitution,
            color="#1d4f9c",
        )
        return {TABLE: table.box, PUCK: cylinder}

    @property
    def object(self) -> str | None:
        """The puck."""
        return PUCK

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        yield from super()._find_contradictions()
        for axis in "xy":
            place, middle = getattr(self.puck, f"{axis}_m"), getattr(self.table, f"{axis}_m")
            half = getattr(self.table, f"size_{axis}_m") / 2
            if abs(place - middle) > half:
                between = f"{middle - half:g} to {middle + half:g}"
                yield f"puck.{axis}_m", f"should be on the table, {between}, got {place:g}"
