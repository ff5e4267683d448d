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
    return _Reader(root, name, find_mesh).read()


def read_visual(link: ElementTree.Element, visual: ElementTree.Element) -> LinkShape:
    """Read a shape for viewers; the file of a mesh is not looked for."""
    return _Reader(link, "robot description", Path).read_shape(visual, of=link)


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


class _Reader:
    """Reads one description."""

    def __init__(self, root: ElementTree.Element, name: str, find_mesh: Callable[[str], Path]) -> None:
        self._root, self._name, self._find_mesh = root, name, find_mesh

    def read(self) -> Urdf:
        root = self._root
        if root.tag != "robot":
            self._fail(f"is {_OTHERS.get(root.tag, f'<{root.tag:.40}>, not URDF, whose root is <robot>')}")
        if any("xacro" in each.tag or "${" in "".join(each.attrib.values()) for each in root.iter()):
            self._fail("is xacro, not URDF; convert it with `xacro FILE > robot.urdf`")
        elements = {self._read_name(link): link for link in root.findall("link")}
        joints = {self._read_name(joint): self._read_joint(joint) for joint in root.findall("joint")}
        for kind, named in (("link", elements), ("joint", joints)):
            if len(named) < len(found := root.findall(kind)):
                names = [element.get("name") for element in found]
                self._fail(f"{kind} {next(name for name in names if names.count(name) > 1)} is there twice")
        if shared := elements.keys() & joints.keys():
            # Pinocchio has a frame for the joint and one for the link, and cannot tell which one is meant.
            raise ConfigError(
                f"{self._name}: a joint has the name of a link: {', '.join(sorted(shared))}",
                hint="rename the joint in a copy",
            )
        first = self._find_root(list(elements), list(joints.values()))
        order = [first, *(name for name in elements if name != first)]
        model = BodyModel(
            name=root.get("name", ""),
            links=tuple(self._read_link(elements[name]) for name in order),
            joints=tuple(joints.values()),
        )
        return Urdf(model)

    def _read_link(self, link: ElementTree.Element) -> BodyLink:
        shapes = []
        for collision in link.findall("collision"):
            shape = self.read_shape(collision, of=link)
            if shape.kind == "mesh":
                from throwcollect.engines.mesh import Mesh

                filename = collision.find("geometry/mesh").get("filename", "")  # type: ignore[union-attr]
                try:
                    shape = replace(shape, mesh=Mesh(self._find_mesh(filename)))
                except ConfigError as error:
                    self._fail(f"link {link.get('name')}: {error.message}")
            shapes.append(shape)
        for visual in link.findall("visual"):
            self.read_shape(visual, of=link)
        return BodyLink(self._read_name(link), self._read_inertia(link), tuple(shapes))

    def _read_inertia(self, link: ElementTree.Element) -> LinkInertia | None:
        """Read mass and inertia, which are there both or not at all."""
        inertial = link.find("inertial")
        if inertial is None:
            return None
        mass, inertia = (self._find(inertial, tag, of=link) for tag in ("mass", "inertia"))
        (mass_kg,) = self._read_numbers(mass, "value", 1, of=link)
        if mass_kg < 0:
            self._fail(f"link {link.get('name')}: value of <mass> should be a mass of at least 0, is {mass_kg:g}")
        moments = tuple(self._read_numbers(inertia, key, 1, of=link)[0] for key in INERTIA)
        return LinkInertia(mass_kg, self._read_placement(inertial, of=link), moments)

    def read_shape(self, element: ElementTree.Element, *, of: ElementTree.Element) -> LinkShape:
        """Read a collision or visual shape of a link, without the file of a mesh."""
        geometry = next(iter(element.findall("geometry/*")), None)
        if geometry is None:
            self._fail(f"link {of.get('name')}: a {element.tag} without geometry")
        if geometry.tag not in SIZES:
            self._fail(f"link {of.get('name')}: unknown shape {geometry.tag:.40}; known: {', '.join(SIZES)}")
        size: list[float] = []
        for key in SIZES[geometry.tag]:
            scale = [1.0] * 3 if key == "scale" else None
            size += self._read_numbers(geometry, key, 3 if key in ("size", "scale") else 1, of=of, default=scale)
        if geometry.tag == "mesh":
            if not all(size) or not geometry.get("filename"):
                self._fail(f"link {of.get('name')}: a mesh should have a filename, and a scale other than 0")
        elif min(size) <= 0:
            self._fail(f"link {of.get('name')}: sizes of a {geometry.tag} should be above 0")
        return LinkShape(geometry.tag, tuple(size), self._read_placement(element, of=of))

    def _read_joint(self, joint: ElementTree.Element) -> BodyJoint:
        name, kind = self._read_name(joint), joint.get("type", "")
        if kind not in _KINDS:
            self._fail(f"joint {name}: unknown type {kind!r:.40}; known: {', '.join(_KINDS)}")
        ends = [self._find(joint, end, of=joint).get("link", "") for end in ("parent", "child")]
        axis, limits, damping, friction = (1.0, 0.0, 0.0), None, 0.0, 0.0
        if kind != "fixed":
            if (element := joint.find("axis")) is not None:
                axis = _as_vector(self._read_numbers(element, "xyz", 3, of=joint))
            if (length := math.hypot(*axis)) < _LEAST_AXIS:
                self._fail(f"joint {name}: its axis {' '.join(f'{each:g}' for each in axis)} has no direction")
            if not math.isclose(length, 1.0):
                axis = _as_vector([each / length for each in axis])
            limits = self._read_limits(joint, kind)
            if (dynamics := joint.find("dynamics")) is not None:
                (damping,), (friction,) = (
                    self._read_numbers(dynamics, key, 1, of=joint, default=[0.0]) for key in ("damping", "friction")
                )
                if damping < 0 or friction < 0:
                    self._fail(f"joint {name}: damping and friction should not be below 0")
        mimic, factor, offset = joint.find("mimic"), 1.0, 0.0
        if mimic is not None:
            (factor,) = self._read_numbers(mimic, "multiplier", 1, of=joint, default=[1.0])
            (offset,) = self._read_numbers(mimic, "offset", 1, of=joint, default=[0.0])
        return BodyJoint(
            name=name,
            kind=kind,
            parent=ends[0],
            child=ends[1],
            placement=self._read_placement(joint, of=joint),
            axis=axis,
            limits=limits,
            damping=damping,
            friction=friction,
            mimics="" if mimic is None else mimic.get("joint", ""),
            mimic_factor=factor,
            mimic_offset=offset,
        )

    def _read_limits(self, joint: ElementTree.Element, kind: str) -> tuple[float, float, float, float] | None:
        element = joint.find("limit")
        if element is None:
            if kind in ("revolute", "prismatic"):
                self._fail(f"joint {joint.get('name')}: has no limit")
            return None
        # A continuous joint has no ends, and others may leave out an end that is 0, as the specification has it.
        lower, upper, velocity, effort = (
            self._read_numbers(
                element,
                key,
                1,
                of=joint,
                default=[0.0] if key in ("lower", "upper") else None,
                largest=math.inf,
            )[0]
            for key in LIMITS
        )
        if kind == "continuous":
            lower, upper = -math.inf, math.inf
        elif not (-math.inf < lower <= upper < math.inf and velocity >= 0 and effort >= 0):
            found = ", ".join(f"{key} {element.get(key)}" for key in LIMITS)
            self._fail(
                f"joint {joint.get('name')}: lower should be at most upper, velocity and effort not below 0: {found}"
            )
        return lower, upper, velocity, effort

    def _find_root(self, links: Sequence[str], joints: Sequence[BodyJoint]) -> str:
        """Find the root of the tree of links, which all joints together have to form."""
        carriers: dict[str, BodyJoint] = {}
        for joint in joints:
            for link in (joint.parent, joint.child):
                if link not in links:
                    self._fail(f"joint {joint.name}: there is no link {link!r:.80}")
            if joint.child in carriers:
                self._fail(f"link {joint.child} hangs on two joints: {carriers[joint.child].name} and {joint.name}")
            carriers[joint.child] = joint
        roots = [link for link in links if link not in carriers]
        if len(roots) > 1:
            self._fail(f"links {roots[0]} and {roots[1]} are not connected")
        try:
            TopologicalSorter({child: [joint.parent] for child, joint in carriers.items()}).prepare()
        except CycleError:
            self._fail("the joints form a ring")
        if not roots:
            self._fail("has no links")
        return roots[0]

    def _read_name(self, element: ElementTree.Element) -> str:
        name = element.get("name", "")
        if not name:
            self._fail(f"a {element.tag} has no name")
        return name

    def _find(self, element: ElementTree.Element, tag: str, *, of: ElementTree.Element) -> ElementTree.Element:
        found = element.find(tag)
        if found is None:
            self._fail(f"{of.tag} {of.get('name')}: <{element.tag}> without <{tag}>")
        return found

    def _read_placement(self, element: ElementTree.Element, *, of: ElementTree.Element) -> Placement:
        origin = element.find("origin")
        if origin is None:
            return Placement()
        xyz, rpy = (_as_vector(self._read_numbers(origin, key, 3, of=of, default=[0.0] * 3)) for key in ("xyz", "rpy"))
        return Placement(xyz, rpy)

    def _read_numbers(
        self,
        element: ElementTree.Element,
        key: str,
        count: int,
        *,
        of: ElementTree.Element,
        default: list[float] | None = None,
        largest: float = _LARGEST_NUMBER,
    ) -> list[float]:
        text = element.get(key)
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
            self._fail(f"{of.tag} {of.get('name')}: {key} of <{element.tag}> should be {numeral}, {given}")
        return values

    def _fail(self, message: str) -> NoReturn:
        raise ConfigError(f"{self._name}: {message}")


def _as_vector(numbers: Sequence[float]) -> Vector:
    x, y, z = numbers
    return x, y, z
