"""What viewers draw of robot and bodies: URDF texts without collision shapes, their shapes, files of meshes."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.engines.body import BodyModel, Placement, Vector, turn_of
from throwcollect.engines.engine import Quaternion
from throwcollect.engines.pose import multiply
from throwcollect.episode.frames import WORLD
from throwcollect.episode.topics import rotate
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.description import full_description, robot_of
from throwcollect.robots.surroundings import looks_of, moving_bodies_of, object_of
from throwcollect.robots.tools.tool import tool_of
from throwcollect.robots.urdf import PACKAGE, parse_xml, read_visual

Rgba = tuple[float, float, float, float]

_TOOL_RGBA: Rgba = (0.55, 0.35, 0.2, 1.0)
_DEFAULT_RGBA: Rgba = (1.0, 1.0, 1.0, 1.0)
_MOUNT_RGBA: Rgba = (0.55, 0.56, 0.59, 1.0)
_MOUNT_RADIUS_M = 0.08


@dataclass(frozen=True)
class DrawnShape:
    """A shape of a link.

    Attributes:
        link: The link, whose frame it moves with.
        position: Its origin in that frame [m].
        rotation_xyzw: Unit quaternion, shape to frame.
        size: Edge lengths of a box, or of the box around a sphere or a cylinder along z [m]; scale of a mesh.
        kind: ``box``, ``cylinder``, ``sphere`` or ``mesh``.
        mesh: Path or URL of the mesh's file in the description; empty if it is none.
        rgba: Its colour.
        body: Name of the body that it belongs to; empty for a shape of the robot.
    """

    link: str
    position: tuple[float, ...]
    rotation_xyzw: tuple[float, ...]
    size: tuple[float, ...]
    kind: str
    mesh: str
    rgba: Rgba
    body: str = ""

    @property
    def name(self) -> str:
        """Name of the body, or of the link."""
        return self.body or self.link


@dataclass(frozen=True)
class DrawnRobot:
    """The robot as viewers draw it.

    Attributes:
        urdf: URDF text without collision shapes.
        shapes: The shapes in it.
        locate: Finds the file of a mesh by its path or URL (see `Robot.locate`).
    """

    urdf: str
    shapes: tuple[DrawnShape, ...]
    locate: Callable[[str], Path]

    @property
    def meshes(self) -> dict[str, Path]:
        """The mesh files, by their paths or URLs."""
        return {mesh: self.locate(mesh) for mesh in sorted({shape.mesh for shape in self.shapes if shape.mesh})}

    def copy_package(self, directory: Path) -> None:
        """Put the meshes of packages into a directory, with a ``package.xml`` by which viewers find them."""
        meshes = {url.removeprefix(PACKAGE): file for url, file in self.meshes.items() if url.startswith(PACKAGE)}
        for mesh, file in meshes.items():
            target = directory / mesh
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        for package in sorted({mesh.split("/", 1)[0] for mesh in meshes}):
            path = Path(package, "package.xml")
            source = self.locate(f"{PACKAGE}{path}")
            text = source.read_text(encoding="utf-8") if source.exists() else "<package><name></name></package>\n"
            # URLs of meshes contain the name of the directory, but Foxglove looks for the name in `package.xml`.
            renamed = re.sub(r"<name>[^<]*</name>", f"<name>{package}</name>", text, count=1)
            (directory / path).write_text(renamed, encoding="utf-8")


def draw_robot_of(config: Config, description: str | None = None) -> DrawnRobot:
    """Read the robot with its tool and its mount as viewers draw it.

    Writing its description needs Pinocchio; a recorded one does not.
    """
    text = full_description(config) if description is None else description
    return read_drawn_robot(text, tool_of(config).link, robot_of(config).locate, config.robot.mount_height_m)


@lru_cache(maxsize=4)
def read_drawn_robot(description: str, tool: str, locate: Callable[[str], Path], mount_m: float = 0.0) -> DrawnRobot:
    """Read a URDF text as viewers draw it, on a column of that height; the link of the tool has a colour of its own."""
    try:
        robot = parse_xml(description, "robot description")
        for link in robot.iter("link"):
            for shape in link.findall("collision"):
                link.remove(shape)
            if link.get("name") == tool:
                for shape in link.findall("visual"):
                    for material in shape.findall("material"):
                        shape.remove(material)
                    shape.append(_make_material("tool", _TOOL_RGBA))
        if mount_m > 0:
            children = {joint.attrib["link"] for joint in robot.iterfind("joint/child")}
            next(link for link in robot.iter("link") if link.get("name") not in children).append(_make_mount(mount_m))
        # A material may be defined at one place of a URDF, and only named at others.
        colors = {name: rgba for each in robot.iter("material") for name, rgba in _read_color(each).items() if name}
        shapes = tuple(
            _read_shape(link, visual, colors) for link in robot.iter("link") for visual in link.iter("visual")
        )
    except (ConfigError, KeyError, ValueError) as error:
        raise DatasetError(f"robot description: cannot be drawn: {error}") from error
    return DrawnRobot(ElementTree.tostring(robot, encoding="unicode"), shapes, locate)


def draw_bodies_of(config: Config) -> tuple[DrawnShape, ...]:
    """Make the shapes of the bodies in the world of a trial: in the frame of the world, or of a body that moves."""
    moving, shapes = moving_bodies_of(config), []
    for look in looks_of(config):
        frame, (place, turn) = look.name, (look.within.xyz, turn_of(look.within))
        if look.name not in moving:
            frame, (place, turn) = WORLD, _move(Placement(look.position_m, look.rpy_rad), look.within)
        shapes.append(
            DrawnShape(frame, place, turn, look.size_m, look.shape, look.mesh, read_hex(look.color), look.name)
        )
    return tuple(shapes)


def _move(body: Placement, within: Placement) -> tuple[Vector, Quaternion]:
    """Find the pose of something in a body in the frame of that body's pose: position [m], and rotation."""
    turn = turn_of(body)
    ((offset,),) = rotate(np.array([turn]), np.array([within.xyz]), inverse=False)
    x, y, z = (np.array(body.xyz) + offset).tolist()
    return (x, y, z), multiply(turn, turn_of(within))


def draw_object_of(config: Config) -> str:
    """URDF text of the object, whose only link is its frame."""
    link, colour = object_of(config).link, draw_bodies_of(config)[-1].rgba
    robot = ElementTree.fromstring(BodyModel(link.name, (replace(link, inertia=None),)).write_urdf())  # noqa: S314
    for shape in robot.iter("collision"):
        shape.tag = "visual"
        shape.append(_make_material(link.name, colour))
    return ElementTree.tostring(robot, encoding="unicode")


def _make_mount(height_m: float) -> ElementTree.Element:
    """Make the column from the ground to the base."""
    shape = ElementTree.Element("visual")
    ElementTree.SubElement(shape, "origin", xyz=f"0 0 {-height_m / 2!r}")
    geometry = ElementTree.SubElement(shape, "geometry")
    ElementTree.SubElement(geometry, "cylinder", radius=repr(_MOUNT_RADIUS_M), length=repr(height_m))
    shape.append(_make_material("mount", _MOUNT_RGBA))
    return shape


def _make_material(name: str, rgba: Rgba) -> ElementTree.Element:
    material = ElementTree.Element("material", name=name)
    ElementTree.SubElement(material, "color", rgba=" ".join(map(repr, rgba)))
    return material


def read_hex(color: str) -> Rgba:
    """Read a colour such as ``#ff7300``."""
    r, g, b = (value / 255 for value in bytes.fromhex(color[1:]))
    return r, g, b, 1.0


def _read_color(material: ElementTree.Element) -> dict[str, Rgba]:
    """The name of a material and the colour that it defines, if it defines one."""
    color = material.find("color")
    if color is None:
        return {}
    r, g, b, a = map(float, color.attrib["rgba"].split())
    return {material.get("name", ""): (r, g, b, a)}


def _read_shape(link: ElementTree.Element, visual: ElementTree.Element, colors: dict[str, Rgba]) -> DrawnShape:
    shape, material = read_visual(link, visual), visual.find("material")
    mesh, size = "", shape.size
    if shape.kind == "mesh":
        mesh = visual.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
    elif shape.kind == "capsule":
        raise ValueError(f"link {link.get('name')} has a capsule")
    elif shape.kind != "box":
        radius, *length = shape.size
        size = (2 * radius, 2 * radius, *(length or [2 * radius]))
    # A material need not have a name, so the colour that the shape itself defines comes first.
    found = {} if material is None else colors | _read_color(material)
    rgba = _DEFAULT_RGBA if material is None else found.get(material.get("name", ""), _DEFAULT_RGBA)
    place, turn = shape.placement.xyz, turn_of(shape.placement)
    return DrawnShape(link.attrib["name"], place, turn, size, shape.kind, mesh, rgba)
