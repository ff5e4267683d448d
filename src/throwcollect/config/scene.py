"""Keys of the world around the robot: the ball, the ground, the air, and the bodies of the scene."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field
from typing_extensions import Self

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Angle, Section, any_of

BALL = "ball"
"""Name of the ball, as that of a body."""

_Length = Annotated[float, Field(ge=0.001, le=20)]
_Factor = Annotated[float, Field(ge=1e-6, le=1e6)]
_Triple = Annotated[list[Annotated[float, Field(ge=-20, le=20)]], Field(min_length=3, max_length=3)]
_Color = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
BodyName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,31}$")]


class BallConfig(Section):
    """The ball, which lies in the tool at the start, or is held by it."""

    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.045
    """Mass."""
    radius_m: Annotated[float, Field(ge=0.005, le=0.1)] = 0.025
    """Radius."""
    friction: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Coulomb friction of the ball [-]; it is multiplied with the friction of the body that it touches."""
    restitution: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Coefficient of restitution between the ball and whatever it touches [-]; at a body of the scene, it is multiplied
    with that of the body."""
    rolling_friction_m: Annotated[float, Field(ge=0, le=0.01)] = 0.0
    """Lever arm with which a surface resists rolling; it is multiplied with the friction of that surface. A ball needs
    some to come to rest."""
    drag_coefficient: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Drag coefficient of a sphere [-]; about 0.47 in air. Quadratic drag acts during the whole trial."""


class BodyConfig(Section):
    """A body of the scene."""

    position_m: Annotated[_Triple, Key(swept=True)] = [0.0, 0.0, 0.0]
    """Position of its centre in world at the start, for shapes of a file that of their origin: x, y, z. With `lies_on`,
    it counts from the place that follows from that."""
    lies_on: BodyName | None = None
    """Name of the body on the middle of which it lies at the start; the object may lie in the tool. Null for none."""
    velocity_mps: Annotated[_Triple, Key(swept=True)] = [0.0, 0.0, 0.0]
    """Velocity of a body that moves in world at the start: x, y, z."""
    rpy_rad: Annotated[list[Angle], Field(min_length=3, max_length=3), Key(swept=True)] = [0.0, 0.0, 0.0]
    """Rotations about the axes x, y, z of the world, in this order."""
    mass_kg: Annotated[Annotated[float, Field(gt=0, le=100)] | None, Key(swept=True)] = None
    """Mass of a body that moves when it is pushed; null for one that stays where it is. Only the first is recorded."""
    friction: Annotated[float, Field(ge=0, le=2), Key(swept=True)] = 0.5
    """Coulomb friction [-]; it is multiplied with that of what touches the body."""
    restitution: Annotated[Annotated[float, Field(ge=0, le=1)] | None, Key(swept=True)] = None
    """Coefficient of restitution [-]; it is multiplied with that of what touches the body, which is 1 for the ground
    and the robot. Null: 0 for a body that moves, otherwise 1."""
    rolling_friction_m: Annotated[float, Field(ge=0, le=0.01), Key(swept=True)] = 0.0
    """Lever arm with which a surface resists the rolling of a body that moves; it is multiplied with the friction of
    that surface."""
    color: Annotated[_Color, Key(Effect.APPEARANCE, swept=False)] = "#8a6f4d"
    """Color in pictures: # and six hexadecimal digits."""


class BoxConfig(BodyConfig):
    """A box."""

    shape: Literal["box"]
    """Shape of the body."""
    size_m: Annotated[list[_Length], Field(min_length=3, max_length=3), Key(swept=True)]
    """Lengths of its edges along its own axes x, y, z."""


class CylinderConfig(BodyConfig):
    """A cylinder along its own axis z."""

    shape: Literal["cylinder"]
    """Shape of the body."""
    radius_m: Annotated[_Length, Key(swept=True)]
    """Radius."""
    length_m: Annotated[_Length, Key(swept=True)]
    """Length."""


class SphereConfig(BodyConfig):
    """A sphere."""

    shape: Literal["sphere"]
    """Shape of the body."""
    radius_m: Annotated[_Length, Key(swept=True)]
    """Radius."""


class FileBodyConfig(BodyConfig):
    """A body whose shapes are in a file, which a dataset carries."""

    suffix: ClassVar[str]

    file: Annotated[str, Key(Effect.RUN, swept=False, operator=True)]
    """The file; a relative path starts at the directory of the configuration file."""
    sha256: str | None = None
    """Digest of what the file describes; it is written with a dataset."""

    def in_directory(self, directory: Path) -> Self:
        """Make a section whose file is the one that a dataset has in a directory, once its digest is known."""
        place = {} if self.sha256 is None else {"file": str(directory / f"{self.sha256[:16]}{self.suffix}")}
        return self.model_copy(update=place)


class MeshConfig(FileBodyConfig):
    """The convex hull of a mesh in an STL, OBJ or COLLADA file, as which it collides; pictures show the mesh itself."""

    suffix = ".stl"

    shape: Literal["mesh"]
    """Shape of the body."""
    scale: Annotated[list[_Factor], Field(min_length=3, max_length=3), Key(swept=True)] = [1.0, 1.0, 1.0]
    """Factors on the coordinates x, y, z of the file, which are then in m; of a file in mm, 0.001."""


class UrdfConfig(FileBodyConfig):
    """The one rigid body of a URDF, whose joints have to be fixed.

    Its collision shapes count, also in pictures. Its mass is `mass_kg`; those of the URDF define how it is spread, and
    without any it is spread evenly.
    """

    suffix = ".urdf"

    shape: Literal["urdf"]
    """Shape of the body."""


if TYPE_CHECKING:
    AnyBody = BoxConfig | CylinderConfig | SphereConfig | MeshConfig | UrdfConfig
else:
    AnyBody = any_of(
        {"box": BoxConfig, "cylinder": CylinderConfig, "sphere": SphereConfig, "mesh": MeshConfig, "urdf": UrdfConfig},
        lambda value: value.get("shape", "box") if isinstance(value, dict) else None,
    )


class SceneConfig(Section):
    """The rest of the world."""

    gravity_mps2: Annotated[float, Field(gt=0, le=30)] = 9.81
    """Gravity, downwards."""
    landing_height_m: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Height of the landing plane: a throw lands when the ball's lowest point crosses it, downwards."""
    air_density_kgpm3: Annotated[float, Field(ge=0, le=10)] = 1.2
    """Density of the air, for the ball's drag."""
    spoon_friction: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Coulomb friction of all that the ball may touch, whatever the tool is [-]: the tool, the robot's links and the
    ground. It is multiplied with `ball.friction`."""
    bodies: Annotated[dict[BodyName, AnyBody], Field(max_length=32)] = {}
    """Things that stand in the world, such as a table or a wall, by name. The object collides with them; a motion in
    which the robot touches one is refused, unless that is the object."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if "ground" in self.bodies:
            yield "bodies.ground", "should have another name, as contacts with the ground have this one"
        for name, body in self.bodies.items():
            if body.mass_kg is None and any(body.velocity_mps):
                yield f"bodies.{name}.velocity_mps", "should be left out, as a body without mass_kg never moves"
