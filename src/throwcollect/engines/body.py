"""Bodies of links and joints as values, which engines get in the place of a description's file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from throwcollect.engines.mesh import Mesh

Vector = tuple[float, float, float]

INERTIA: Mapping[str, tuple[int, int]] = {
    "ixx": (0, 0),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyy": (1, 1),
    "iyz": (1, 2),
    "izz": (2, 2),
}
"""Names of the six numbers of an inertia in URDF, and their row and column in the matrix."""

SIZES: Mapping[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("scale",),
}
"""Kinds of shapes in URDF, and the attributes that hold their sizes."""


class Placement(NamedTuple):
    """Pose in a parent frame: origin [m], then rotations about the parent's axes x, y, z in this order [rad]."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


HERE = Placement()


def turn_of(placement: Placement) -> tuple[float, float, float, float]:
    """Write the rotations of a placement as a unit quaternion, xyzw."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(angle / 2), math.cos(angle / 2)) for angle in placement.rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


@dataclass(frozen=True)
class LinkShape:
    """A shape of a link.

    Attributes:
        kind: One of `SIZES`.
        size: Edges of a box, radius of a sphere, radius and length along z of a cylinder or capsule (of its straight
            part) [m]; factors for the coordinates of a mesh.
        placement: Pose in the link.
        mesh: The mesh, which collides as its convex hull; None if it is none.
    """

    kind: str
    size: tuple[float, ...]
    placement: Placement
    mesh: Mesh | None = None

    @property
    def radius_m(self) -> float:
        """Radius of the sphere around a box, cylinder or sphere [m]."""
        match self.kind, self.size:
            case "box", (x, y, z):
                return math.hypot(x / 2, y / 2, z / 2)
            case "cylinder", (radius, length):
                return math.hypot(radius, length / 2)
        return self.size[0]


def moments_of(kind: str, size: Sequence[float], mass_kg: float) -> tuple[float, float, float]:
    """Moments of inertia of a solid box, cylinder or sphere about its centre, along its own axes [kg m²]."""
    match kind, tuple(size):
        case "box", (x, y, z):
            moments = (y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12
        case "cylinder", (radius, length):
            across = radius * radius / 4 + length * length / 12
            moments = across, across, radius * radius / 2
        case _, (radius,):
            # The bytes of throws depend on the order of these factors.
            return (0.4 * mass_kg * radius**2,) * 3
    return mass_kg * moments[0], mass_kg * moments[1], mass_kg * moments[2]


@dataclass(frozen=True)
class LinkInertia:
    """Mass of a link and how it is spread.

    Attributes:
        mass_kg: Mass.
        placement: Pose in the link of the centre of mass and of the axes of `moments_kgm2`.
        moments_kgm2: The six numbers of the inertia about the centre of mass, in the order of `INERTIA`.
    """

    mass_kg: float
    placement: Placement
    moments_kgm2: tuple[float, ...]

    @property
    def diagonal(self) -> list[float]:
        """The moments about the axes x, y, z [kg m²]."""
        xx, _, _, yy, _, zz = self.moments_kgm2
        return [xx, yy, zz]

    @property
    def is_centred(self) -> bool:
        """Whether the frame of the link is that of its centre of mass and of its principal axes."""
        _, xy, xz, _, yz, _ = self.moments_kgm2
        return self.placement == HERE and not (xy or xz or yz)


@dataclass(frozen=True)
class BodyLink:
    """A rigid link; `inertia` is None for links without a mass, such as frames of sensors."""

    name: str
    inertia: LinkInertia | None = None
    shapes: tuple[LinkShape, ...] = ()

    @property
    def is_plain(self) -> bool:
        """Whether it is one box, cylinder, sphere or capsule around its origin."""
        plain = [shape.mesh is None and shape.placement == HERE for shape in self.shapes] == [True]
        return plain and (self.inertia is None or self.inertia.is_centred)


@dataclass(frozen=True)
class BodyJoint:
    """A joint between two links.

    Attributes:
        name: Its name.
        kind: ``fixed``, ``revolute``, ``continuous``, ``prismatic``, or another kind of URDF.
        parent: Name of the link that it hangs on.
        child: Name of the link that it moves.
        placement: Pose in the parent of the child's frame, while the joint is at 0.
        axis: Unit vector in the child's frame.
        limits: Lowest and highest position [rad or m], highest speed [rad/s or m/s] and effort [Nm or N]; None if it
            has none.
        damping: Viscous friction [Nms/rad or Ns/m].
        friction: Dry friction [Nm or N], which motors overcome.
        mimics: Name of the joint that it follows; empty if it follows none.
        mimic_factor: Position of this joint over that of the joint that it follows.
        mimic_offset: Position of this joint while the one that it follows is at 0 [rad or m].
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Placement = HERE
    axis: Vector = (1.0, 0.0, 0.0)
    limits: tuple[float, float, float, float] | None = None
    damping: float = 0.0
    friction: float = 0.0
    mimics: str = ""
    mimic_factor: float = 1.0
    mimic_offset: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether it lets its child move."""
        return self.kind != "fixed"


LIMITS = ("lower", "upper", "velocity", "effort")
"""Names in URDF of the limits of a joint, in the order of `BodyJoint.limits`."""


@dataclass(frozen=True)
class BodyModel:
    """A tree of links and joints.

    Attributes:
        name: Its name.
        links: The links; the first is the root, which all others hang on.
        joints: The joints.
    """

    name: str
    links: tuple[BodyLink, ...]
    joints: tuple[BodyJoint, ...] = ()

    @property
    def moving(self) -> tuple[BodyJoint, ...]:
        """The joints that let links move."""
        return tuple(joint for joint in self.joints if joint.moves)

    @cached_property
    def meshes(self) -> tuple[Mesh, ...]:
        """All meshes, each once; the description names them ``0.stl``, ``1.stl`` and so on."""
        shapes = (shape for link in self.links for shape in link.shapes)
        return tuple(dict.fromkeys(shape.mesh for shape in shapes if shape.mesh is not None))

    def encode_meshes(self) -> dict[str, bytes]:
        """Encode the meshes as binary STL, by the names that the description has for them."""
        return {f"{number}.stl": mesh.encode() for number, mesh in enumerate(self.meshes)}

    def rename_links(self, names: Mapping[str, str]) -> BodyModel:
        """Give links new names, by the old ones; the others keep theirs."""
        links = (replace(link, name=names.get(link.name, link.name)) for link in self.links)
        joints = (
            replace(each, parent=names.get(each.parent, each.parent), child=names.get(each.child, each.child))
            for each in self.joints
        )
        return replace(self, links=tuple(links), joints=tuple(joints))

    def write_urdf(self) -> str:
        """Write URDF without visual shapes."""
        robot = ElementTree.Element("robot", name=self.name)
        robot.extend(self.to_xml())
        return to_text(robot)

    def to_xml(self) -> Iterator[ElementTree.Element]:
        """Make the elements of the links, and then of the joints."""
        yield from map(self._write_link, self.links)
        yield from map(_write_joint, self.joints)

    def _write_link(self, link: BodyLink) -> ElementTree.Element:
        element = ElementTree.Element("link", name=link.name)
        if link.inertia is not None:
            inertial = ElementTree.SubElement(element, "inertial")
            inertial.append(_write_placement(link.inertia.placement))
            ElementTree.SubElement(inertial, "mass", value=_write(link.inertia.mass_kg))
            moments = zip(INERTIA, map(_write, link.inertia.moments_kgm2), strict=True)
            ElementTree.SubElement(inertial, "inertia", dict(moments))
        for shape in link.shapes:
            collision = ElementTree.SubElement(element, "collision")
            collision.append(_write_placement(shape.placement))
            keys = SIZES[shape.kind]
            texts = [_write(*shape.size)] if len(keys) == 1 else map(_write, shape.size)
            name = {} if shape.mesh is None else {"filename": f"{self.meshes.index(shape.mesh)}.stl"}
            geometry = ElementTree.SubElement(collision, "geometry")
            ElementTree.SubElement(geometry, shape.kind, name | dict(zip(keys, texts, strict=True)))
        return element


def to_text(robot: ElementTree.Element) -> str:
    """Write the text of a description, in lines, as Bullet reads lines of bounded length."""
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _write_joint(joint: BodyJoint) -> ElementTree.Element:
    element = ElementTree.Element("joint", name=joint.name, type=joint.kind)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    element.append(_write_placement(joint.placement))
    if joint.moves:
        ElementTree.SubElement(element, "axis", xyz=_write(*joint.axis))
    if joint.limits is not None:
        ElementTree.SubElement(element, "limit", dict(zip(LIMITS, map(_write, joint.limits), strict=True)))
    if joint.damping or joint.friction:
        ElementTree.SubElement(element, "dynamics", damping=_write(joint.damping), friction=_write(joint.friction))
    return element


def _write_placement(placement: Placement) -> ElementTree.Element:
    return ElementTree.Element("origin", xyz=_write(*placement.xyz), rpy=_write(*placement.rpy))


def _write(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)
