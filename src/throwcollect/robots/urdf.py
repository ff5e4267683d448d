"""Reads URDF strictly, once, for everything that needs a description: physics, plans, frames and viewers.

Each library that reads URDF drops other things without a word. So all of them get what was understood here.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NoReturn
from urllib.parse import unquote, urlsplit

from throwcollect.engines.body import (
    INERTIA,
    LIMITS,
    SIZES,
    BodyJoint,
    BodyLink,
    BodyModel,
    LinkInertia,
    LinkShape,
    Placement,
    Vector,
)
from throwcollect.errors import ConfigError

PACKAGE = "package://"
"""Beginning of the URLs of meshes in a description, which the name of a package follows."""

_LARGEST_NUMBER = 1e6
_LARGEST_BYTES = 32 << 20
_OTHERS = {
    "mujoco": "MJCF, not URDF; mjcf-urdf-simple-converter converts it",
    "sdf": "SDF, not URDF; sdf2urdf of sdformat_tools converts it",
    "#usda": "USD, not URDF; usd_to_urdf of nvidia-srl-usd-to-urdf converts it",
    "PXR-U": "USD, not URDF; usd_to_urdf of nvidia-srl-usd-to-urdf converts it",
}
"""Other formats, by the root or the first bytes of a file, and what converts them."""
_LEAST_AXIS = 1e-3
_KINDS = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")


@dataclass(frozen=True)
class Urdf:
    """Links, collision shapes and joints of a description; the first link of `model` is the root."""

    model: BodyModel

    @cached_property
    def links(self) -> Mapping[str, BodyLink]:
        """The links by name."""
        return {link.name: link for link in self.model.links}

    @cached_property
    def joints(self) -> Mapping[str, BodyJoint]:
        """The joints by name."""
        return {joint.name: joint for joint in self.model.joints}


def parse_xml(content: str | bytes, name: str) -> ElementTree.Element:
    """Parse the XML of a description.

    Args:
        content: The text, or the bytes of a file.
        name: The file, or what stands for it in messages.
    """
    try:
        return ElementTree.fromstring(content)  # noqa: S314 - expat limits the growth of entities since 2.4
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        # An encoding that Python does not know is a LookupError.
        begin = content[:5] if isinstance(content, str) else content[:5].decode("latin-1")
        wrong = f"not well-formed XML: {error}" if begin else "the file is empty"
        if begin in _OTHERS:
            wrong = f"is {_OTHERS[begin]}"
        raise ConfigError(f"{name}: cannot be read as robot description: {wrong}") from error


def read_xml(path: Path) -> ElementTree.Element:
    """Read the XML of a file of a robot's description."""
    try:
        if (size := path.stat().st_size) > _LARGEST_BYTES:
            raise ConfigError(
                f"{path}: a description of {size >> 20} MB", expected=f"at most {_LARGEST_BYTES >> 20} MB"
            )
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read as robot description: {error.strerror}") from error
    return parse_xml(content, str(path))


def read_urdf(root: ElementTree.Element, name: str, *, find_mesh: Callable[[str], Path] = Path) -> Urdf:
    """Read and check a description.

    Args:
        root: Its XML.
        name: The file, or what stands for it in messages.
        find_mesh: Finds the file of a collision mesh by its ``filename``.
    """
    robot = _Element(root, name)
    if root.tag != "robot":
        robot.fail(f"is {_OTHERS.get(root.tag, f'<{root.tag:.40}>, not URDF, whose root is <robot>')}")
    if any("xacro" in each.tag or "${" in "".join(each.attrib.values()) for each in root.iter()):
        robot.fail("is xacro, not URDF; convert it with `xacro FILE > robot.urdf`")
    elements, joints = robot.list_named("link"), robot.list_named("joint")
    if shared := elements.keys() & joints.keys():
        # Pinocchio has a frame for the joint and one for the link, and cannot tell which one is meant.
        raise ConfigError(
            f"{name}: a joint has the name of a link: {', '.join(sorted(shared))}", hint="rename the joint in a copy"
        )
    read = tuple(_read_joint(joint, each) for joint, each in joints.items())
    first = _find_root(robot, list(elements), read)
    order = [first, *(link for link in elements if link != first)]
    links = tuple(_read_link(link, elements[link], find_mesh) for link in order)
    return Urdf(BodyModel(name=root.get("name", ""), links=links, joints=read))


def read_visual(link: ElementTree.Element, visual: ElementTree.Element) -> LinkShape:
    """Read a shape for viewers; the file of a mesh is not looked for."""
    return _Element(visual, f"robot description: link {link.get('name')}").read_shape()


def locate_mesh(filename: str, directory: Path, packages: Path) -> Path:
    """Find the file that a description in a directory means by a path or a URL; `packages` holds all packages."""
    if "://" not in filename:
        return directory / filename
    parts = urlsplit(filename)
    # With three slashes, the package is the first part of the path.
    if parts.scheme == "package":
        return packages / unquote(parts.netloc + parts.path).lstrip("/")
    if parts.scheme == "file" and parts.netloc in ("", "localhost"):
        return Path(unquote(parts.path))
    raise ConfigError(f"{filename!r:.255}: unknown kind of URL", expected="file:///... or package://...")


class _Element:
    """An element of a description.

    Args:
        xml: The element.
        where: Where it stands, for messages: the file, and a link or a joint in it.
    """

    def __init__(self, xml: ElementTree.Element, where: str) -> None:
        self.xml, self._where = xml, where

    def fail(self, message: str) -> NoReturn:
        raise ConfigError(f"{self._where}: {message}")

    def list_named(self, tag: str) -> dict[str, _Element]:
        """List the links or joints by their names, which have to differ."""
        found: dict[str, _Element] = {}
        for each in self.xml.findall(tag):
            if not (name := each.get("name", "")):
                self.fail(f"a {tag} has no name")
            if name in found:
                self.fail(f"{tag} {name} is there twice")
            found[name] = _Element(each, f"{self._where}: {tag} {name}")
        return found

    def list_all(self, path: str) -> list[_Element]:
        return [_Element(each, self._where) for each in self.xml.findall(path)]

    def find(self, tag: str) -> _Element | None:
        return next(iter(self.list_all(tag)), None)

    def require(self, tag: str) -> _Element:
        if (found := self.find(tag)) is None:
            self.fail(f"<{self.xml.tag}> without <{tag}>")
        return found

    def read_numbers(
        self, key: str, count: int = 3, default: list[float] | None = None, largest: float = _LARGEST_NUMBER
    ) -> list[float]:
        text = self.xml.get(key)
        if text is None and default is not None:
            return default
        try:
            values = [float(word) for word in (text or "").split()]
        except ValueError:
            values = []
        # A comparison with NaN is false, so this rejects NaN, too.
        if len(values) != count or not all(abs(value) <= largest for value in values):
            numeral = "a finite number" if count == 1 else f"{count} finite numbers"
            given = "is missing" if text is None else f"is {text!r:.80}"
            self.fail(f"{key} of <{self.xml.tag}> should be {numeral}, {given}")
        return values

    def read_number(self, key: str, default: float | None = None, largest: float = _LARGEST_NUMBER) -> float:
        (number,) = self.read_numbers(key, 1, None if default is None else [default], largest)
        return number

    def read_placement(self) -> Placement:
        if (origin := self.find("origin")) is None:
            return Placement()
        xyz, rpy = (as_vector(origin.read_numbers(key, default=[0.0] * 3)) for key in ("xyz", "rpy"))
        return Placement(xyz, rpy)

    def read_shape(self) -> LinkShape:
        """Read a collision or visual shape, without the file of a mesh."""
        if (geometry := self.find("geometry/*")) is None:
            self.fail(f"a {self.xml.tag} without geometry")
        kind = geometry.xml.tag
        if kind not in SIZES:
            self.fail(f"unknown shape {kind:.40}; known: {', '.join(SIZES)}")
        size: list[float] = []
        for key in SIZES[kind]:
            size += geometry.read_numbers(
                key, 3 if key in ("size", "scale") else 1, [1.0] * 3 if key == "scale" else None
            )
        if kind == "mesh" and not (all(size) and geometry.xml.get("filename")):
            self.fail("a mesh should have a filename, and a scale other than 0")
        if kind != "mesh" and min(size) <= 0:
            self.fail(f"sizes of a {kind} should be above 0")
        return LinkShape(kind, tuple(size), self.read_placement())


def _read_link(name: str, link: _Element, find_mesh: Callable[[str], Path]) -> BodyLink:
    shapes = []
    for collision in link.list_all("collision"):
        shape = collision.read_shape()
        if shape.kind == "mesh":
            from throwcollect.engines.mesh import Mesh

            try:
                path = find_mesh(collision.require("geometry/mesh").xml.get("filename", ""))
            except ConfigError as error:
                link.fail(error.message)
            shape = replace(shape, mesh=Mesh(path))
        shapes.append(shape)
    for visual in link.list_all("visual"):
        visual.read_shape()
    # Mass and inertia are there both or not at all.
    if (inertial := link.find("inertial")) is None:
        return BodyLink(name, None, tuple(shapes))
    mass_kg, inertia = inertial.require("mass").read_number("value"), inertial.require("inertia")
    if mass_kg < 0:
        link.fail(f"value of <mass> should be a mass of at least 0, is {mass_kg:g}")
    moments = tuple(inertia.read_number(key) for key in INERTIA)
    return BodyLink(name, LinkInertia(mass_kg, inertial.read_placement(), moments), tuple(shapes))


def _read_joint(name: str, joint: _Element) -> BodyJoint:
    kind = joint.xml.get("type", "")
    if kind not in _KINDS:
        joint.fail(f"unknown type {kind!r:.40}; known: {', '.join(_KINDS)}")
    parent, child = (joint.require(end).xml.get("link", "") for end in ("parent", "child"))
    read = BodyJoint(name, kind, parent, child, joint.read_placement())
    if (mimic := joint.find("mimic")) is not None:
        factor, offset = mimic.read_number("multiplier", 1.0), mimic.read_number("offset", 0.0)
        read = replace(read, mimics=mimic.xml.get("joint", ""), mimic_factor=factor, mimic_offset=offset)
    if kind == "fixed":
        return read
    axis = [1.0, 0.0, 0.0] if (element := joint.find("axis")) is None else element.read_numbers("xyz")
    if (length := math.hypot(*axis)) < _LEAST_AXIS:
        joint.fail(f"its axis {' '.join(f'{each:g}' for each in axis)} has no direction")
    if not math.isclose(length, 1.0):
        axis = [each / length for each in axis]
    damping, friction = 0.0, 0.0
    if (dynamics := joint.find("dynamics")) is not None:
        damping, friction = (dynamics.read_number(key, 0.0) for key in ("damping", "friction"))
    if damping < 0 or friction < 0:
        joint.fail("damping and friction should not be below 0")
    limits = _read_limits(joint, kind)
    return replace(read, axis=as_vector(axis), limits=limits, damping=damping, friction=friction)


def _read_limits(joint: _Element, kind: str) -> tuple[float, float, float, float] | None:
    if (limit := joint.find("limit")) is None:
        if kind in ("revolute", "prismatic"):
            joint.fail("has no limit")
        return None
    # A continuous joint has no ends, and others may leave out an end that is 0, as the specification has it.
    lower, upper = (limit.read_number(key, 0.0, math.inf) for key in ("lower", "upper"))
    velocity, effort = (limit.read_number(key, None, math.inf) for key in ("velocity", "effort"))
    if kind == "continuous":
        lower, upper = -math.inf, math.inf
    elif not (-math.inf < lower <= upper < math.inf and velocity >= 0 and effort >= 0):
        found = ", ".join(f"{key} {limit.xml.get(key)}" for key in LIMITS)
        joint.fail(f"lower should be at most upper, velocity and effort not below 0: {found}")
    return lower, upper, velocity, effort


def _find_root(robot: _Element, links: Sequence[str], joints: Sequence[BodyJoint]) -> str:
    """Find the root of the tree of links, which all joints together have to form."""
    carriers: dict[str, BodyJoint] = {}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                robot.fail(f"joint {joint.name}: there is no link {link!r:.80}")
        if joint.child in carriers:
            robot.fail(f"link {joint.child} hangs on two joints: {carriers[joint.child].name} and {joint.name}")
        carriers[joint.child] = joint
    roots = [link for link in links if link not in carriers]
    if len(roots) > 1:
        robot.fail(f"links {roots[0]} and {roots[1]} are not connected")
    try:
        TopologicalSorter({child: [joint.parent] for child, joint in carriers.items()}).prepare()
    except CycleError:
        robot.fail("the joints form a ring")
    if not roots:
        robot.fail("has no links")
    return roots[0]


def as_vector(numbers: Sequence[float]) -> Vector:
    """Make a vector of three numbers."""
    x, y, z = numbers
    return x, y, z
