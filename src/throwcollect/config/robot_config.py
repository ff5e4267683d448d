"""Keys of the robot: one that is installed, or one that is described by a URDF."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema
from typing_extensions import Self

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Angle, Joint, Name, Section, any_of
from throwcollect.members import import_own, names_of
from throwcollect.wording import suggest


def _require_robot(name: str) -> str:
    if name not in (known := names_of("robots")):
        raise ValueError(
            f"no robot {name!r} is installed{suggest(name, known)}; docs/robots.md describes how to add one"
        )
    return name


_Vector = Annotated[list[float], Field(min_length=3, max_length=3)]


class RobotConfig(Section):
    """The robot and how its motors follow commands."""

    name: Annotated[str, AfterValidator(_require_robot), WithJsonSchema({"enum": [*names_of("robots")]})] = "talos"
    """Robot, with its base fixed: Talos of PAL Robotics is `talos_reduced` of example-robot-data. Packages may add
    others; `throwcollect robot list` lists them. With `urdf`, it is the name in files and ROS, by default that
    of the URDF."""
    base_height_m: Annotated[float, Field(ge=0, le=3)] = 1.01927
    """Height of the fixed base link above the ground."""
    posture: dict[Joint, Angle] = {}
    """Joint angles that replace angles of the robot's posture at rest (for Talos: half-sitting), for joints that the
    task does not move."""
    locked: Literal["auto", "none"] | list[Joint] = "auto"
    """Joints simulated as rigid: `auto` locks what the task does not move, `none` simulates all, or a list."""
    position_gain_per_s: Annotated[float, Field(gt=0, le=1000), Key(swept=True)] = 100.0
    """Velocity commanded per radian of position error; with Bullet, its position gain is this times the time step."""
    velocity_gain: Annotated[float, Field(gt=0, le=1), Key(swept=True)] = 1.0
    """Share of the velocity error that a motor removes in one step [-]."""
    effort_scale: Annotated[float, Field(gt=0, le=10), Key(swept=True)] = 1.0
    """Factor on the effort limits of all joints [-]."""
    joint_offsets: Annotated[dict[Joint, Angle], Key(swept=True)] = {}
    """Errors of the joints' zeros: the true angle of such a joint minus the angle that is commanded and measured."""
    speed_scale: Annotated[float, Field(gt=0.5, lt=2), Key(swept=True)] = 1.0
    """Speed of the clock by which controllers follow trajectories [-]: below 1, motions take longer than planned."""
    motor_lag_s: Annotated[float, Field(ge=0, le=0.2), Key(swept=True)] = 0.0
    """Time constant with which motors follow their commands; 0: at once."""

    @property
    def mount_height_m(self) -> float:
        """Height of the mount that viewers draw below the base: none, as the robot has feet."""
        return 0.0

    def without_place(self) -> "RobotConfig":
        """Make a section that is the same wherever the robot's files lie."""
        return self

    def find(self) -> Any:
        """Find the robot, a `throwcollect.robots.robot.Robot`, which only simulations import when they start."""
        return import_own("throwcollect.robots.importing:find_robot")(self)


class ToolPose(Section):
    """Pose of the hand, which holds the tool, in the flange: the handle lies along -z, and the cup opens along +x."""

    position_m: _Vector = [0.0, 0.0, -0.1]
    """Origin; the spoon's handle begins `tool.mount_offset_m` from there, by default at the flange."""
    rpy_rad: _Vector = [3.141592653589793, 0.0, 0.0]
    """Rotations about the axes x, y, z of the flange, in this order; by default, the handle lies along +z of it."""


class LimitsConfig(Section):
    """Limits of a joint that replace those of the URDF; a key that is left out keeps the URDF's."""

    min_position: float | None = None
    """Lowest position [rad; m for a prismatic joint]."""
    max_position: float | None = None
    """Highest position [rad; m]."""
    max_velocity: Annotated[float, Field(gt=0)] | None = None
    """Highest speed [rad/s; m/s]."""
    max_effort: Annotated[float, Field(gt=0)] | None = None
    """Highest effort [Nm; N]."""


class ChainConfig(Section):
    """The joints between two links."""

    chain: Annotated[list[str], Field(min_length=2, max_length=2)]
    """The link nearer to the base, and the one farther from it."""


class DescribedRobotConfig(RobotConfig):
    """A robot that a URDF describes; `throwcollect robot import` writes all of these keys, and how each was found."""

    name: Name = ""
    base_height_m: Annotated[float, Field(ge=0, le=3)] = 0.8
    """Height of the fixed base link above the ground."""
    urdf: Annotated[str, Key(Effect.RUN, operator=True)]
    """The URDF: a path, relative to this file; `package://PACKAGE/PATH`; or `example-robot-data:PATH`, below its
    directory `robots`."""
    packages: Annotated[dict[str, str], Key(Effect.RUN, operator=True)] = {}
    """Directories of packages that the URDF names in `package://` URLs, by name, relative to this file. Others are
    looked for among the directories above the URDF, and in those of ROS."""
    srdf: Annotated[str | None, Key(Effect.RUN, operator=True)] = None
    """The SRDF, with postures and the links that may touch each other; null derives both."""
    flange: str
    """The link that the tool is fixed to."""
    tool_pose: ToolPose = ToolPose()
    """Pose of the hand in the flange."""
    controllers: dict[Name, list[str] | ChainConfig] | None = None
    """Joints of each joint trajectory controller, or the two links that its joints lie between; null makes one
    controller of the joints between base and flange."""
    fixed: dict[str, float] = {}
    """Positions of joints without a controller [rad; m], which are rigid; 0 by default."""
    home: Literal["auto"] | str | dict[str, float] = "auto"
    """The posture at rest: a `group_state` of the SRDF or joint angles; `auto` takes the first one of the SRDF or
    searches one that holds the ball."""
    limits: dict[str, LimitsConfig] = {}
    """Limits that replace those of the URDF, by joint."""
    gripper: Literal["dropped", "kept"] = "dropped"
    """Whether links beyond the flange have no collision shapes, as the tool is in their place, or have them."""
    holding: list[str] | None = None
    """Links that hold the tool and are not checked for collisions with it; null takes the flange and the three links
    before it."""
    prismatic: list[str] = []
    """Joints of controllers that slide: their positions are in m, and their efforts in N. An import finds them."""
    sha256: str | None = None
    """Digest of the files of an imported robot; it is written with a dataset."""

    @property
    def mount_height_m(self) -> float:
        """Height of the mount that viewers draw below the base, which is that of an arm."""
        return self.base_height_m

    def without_place(self) -> RobotConfig:
        """Make a section that is the same wherever the robot's files lie."""
        return (
            self
            if self.sha256 is None
            else self.model_copy(update={"urdf": "robot/robot.urdf", "srdf": "robot/robot.srdf"})
        )

    def below(self, directory: Path) -> Self:
        """Make paths that are relative to a directory absolute."""

        def join(path: str) -> str:
            return path if ":" in path else str(directory.absolute() / path)

        changes = {
            "urdf": join(self.urdf),
            "srdf": None if self.srdf is None else join(self.srdf),
            "packages": {name: join(path) for name, path in self.packages.items()},
        }
        given = self.model_fields_set
        return self.model_copy(update={name: value for name, value in changes.items() if name in given})


AnyRobot = any_of(
    {"named": RobotConfig, "described": DescribedRobotConfig},
    lambda value: "described" if isinstance(value, Mapping) and "urdf" in value else "named",
)
"""Type of the key `robot`."""
