"""Reads URDF of robots and objects from untrusted files, checks it, and writes it anew for the physics engine.

Some descriptions make Bullet end its process, and others make it guess. So Bullet gets only what was understood here:
links with mass and inertia, collision shapes, joints that form a tree.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Collection, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.engine import BodyModel
from throwcollect.errors import RequestError
from throwcollect.sim.mesh import Triangles

_MOST_LINKS = 128
"""Bullet takes no more links."""

_MOST_TRIANGLES = 400_000
_LONGEST_TEXT = 4 * 2**20
_LONGEST_NAME = 255
_LARGEST_NUMBER = 1e6
_LEAST_MASS_KG = 1e-3
"""Mass of links that have none, such as frames of sensors: Bullet would take one kilogram."""

_LEAST_RADIUS_OF_GYRATION_M = 1e-3
_LEAST_AXIS = 1e-3
_ROUNDING = 0.1
"""How negative a principal moment may be, as a share of the largest one; the numbers of descriptions are rounded."""

_LARGEST_SHARE = 0.999

_SIZES = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}
_OTHER_FORMATS = {"sdf": "SDFormat", "mujoco": "MJCF", "COLLADA": "COLLADA", "usd": "USD"}


def read_model(content: str | bytes, read_mesh: Callable[[str], Triangles]) -> BodyModel:
    """Read and check a description.

    Args:
        content: URDF text, or the bytes of a file.
        read_mesh: Reads the triangles of a mesh by its ``filename``; may raise a `RequestError`.

    Raises:
        RequestError: ``RESOURCE_PARSE_ERROR`` if the description is malformed, ``UNSUPPORTED_FORMAT`` if it is no URDF,
            ``UNSUPPORTED_ASSETS`` if its meshes are too large; whatever `read_mesh` raises.
    """
    return _Reader(_parse(content), read_mesh).read()


class _NoDoctype(ElementTree.TreeBuilder):
    """Builds trees of documents without entities: with entities, a few lines can grow to gigabytes."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse a document type declaration.

        Raises:
            RequestError: ``RESOURCE_PARSE_ERROR``, always.
        """
        del pubid, system
        raise _malformed(f"document type {name!r:.40} is declared; descriptions have none")


def _malformed(message: str) -> RequestError:
    return RequestError("RESOURCE_PARSE_ERROR", message)


def _parse(content: str | bytes) -> ElementTree.Element:
    if len(content) > _LONGEST_TEXT:
        raise _malformed(f"a description of {len(content)} characters; at most {_LONGEST_TEXT}")
    parser = ElementTree.XMLParser(target=_NoDoctype())  # noqa: S314 - entities cannot be defined
    try:
        parser.feed(content)
        root: ElementTree.Element = parser.close()
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        # An encoding that Python does not know is a LookupError.
        raise _malformed(f"not well-formed XML: {error}") from error
    if root.tag != "robot":
        kind = _OTHER_FORMATS.get(root.tag, f"<{root.tag:.40}>")
        raise RequestError("UNSUPPORTED_FORMAT", f"the description is {kind}", expected="URDF, whose root is <robot>")
    return root


class _Reader:
    """Reads one description."""

    def __init__(self, root: ElementTree.Element, read_mesh: Callable[[str], Triangles]) -> None:
        self._root = root
        self._read_mesh = read_mesh
        self._meshes: dict[str, Triangles] = {}

    def read(self) -> BodyModel:
        masses: dict[str, float] = {}
        for link in self._root.findall("link"):
            name = _read_name(link)
            if name in masses:
                raise _malformed(f"link {name} is there twice")
            masses[name] = _read_mass(link)
        if not 1 <= len(masses) <= _MOST_LINKS:
            raise _malformed(f"{len(masses)} links; 1 to {_MOST_LINKS} can be simulated")
        joints = [_read_joint(joint) for joint in self._root.findall("joint")]
        rigid = _find_rigid_links(masses, joints)
        # URDF has no word for a body that is attached to the world: such a description calls its root `world`, or gives
        # it no mass.
        is_fixed = rigid[0] == "world" or sum(masses[link] for link in rigid) == 0
        robot = ElementTree.Element("robot", name="entity")
        for link in self._root.findall("link"):
            robot.append(self._write_link(link, masses[_read_name(link)], exact=is_fixed and _read_name(link) in rigid))
        robot.extend(joint.element for joint in joints)
        # Bullet reads lines of bounded length.
        ElementTree.indent(robot)
        text = ElementTree.tostring(robot, encoding="unicode") + "\n"
        movable = sum(joint.kind != "fixed" for joint in joints)
        meshes = tuple(self._meshes.values())
        return BodyModel(self._root.get("name", ""), text, meshes, joints=movable, is_fixed=is_fixed)

    def _write_link(self, link: ElementTree.Element, mass: float, *, exact: bool) -> ElementTree.Element:
        clean = ElementTree.Element("link", name=_read_name(link))
        inertial = ElementTree.SubElement(clean, "inertial")
        if (given := link.find("inertial")) is not None:
            inertial.append(_write_origin(given, of=link))
        ElementTree.SubElement(inertial, "mass", value=repr(max(mass, _LEAST_MASS_KG)))
        ElementTree.SubElement(inertial, "inertia", _write_inertia(link, max(mass, _LEAST_MASS_KG)))
        for collision in link.findall("collision"):
            # Meshes that never move keep their shape; all others become their convex hulls.
            shape = ElementTree.SubElement(clean, "collision", {"concave": "yes"} if exact else {})
            shape.append(_write_origin(collision, of=link))
            ElementTree.SubElement(shape, "geometry").append(self._write_geometry(collision, link))
        return clean

    def _write_geometry(self, collision: ElementTree.Element, link: ElementTree.Element) -> ElementTree.Element:
        shape = next(iter(collision.findall("geometry/*")), None)
        if shape is None:
            raise _malformed(f"link {_read_name(link)}: a collision without geometry")
        if shape.tag == "mesh":
            number = self._number_mesh(shape.get("filename", ""))
            scale = _read_numbers(shape, "scale", 3, of=link, default=[1.0] * 3)
            if not all(scale):
                raise _malformed(f"link {_read_name(link)}: the scale of a mesh should not be 0")
            return ElementTree.Element("mesh", filename=f"{number}.stl", scale=_format_numbers(scale))
        if shape.tag not in _SIZES:
            raise _malformed(
                f"link {_read_name(link)}: unknown shape {shape.tag:.40}; known: {', '.join(_SIZES)}, mesh"
            )
        sizes = {key: _read_numbers(shape, key, 3 if key == "size" else 1, of=link) for key in _SIZES[shape.tag]}
        if any(size <= 0 for values in sizes.values() for size in values):
            raise _malformed(f"link {_read_name(link)}: sizes of a {shape.tag} should be above 0")
        return ElementTree.Element(shape.tag, {key: _format_numbers(values) for key, values in sizes.items()})

    def _number_mesh(self, filename: str) -> int:
        """Find the number of a mesh, and read the mesh when the description first names it.

        Raises:
            RequestError: ``UNSUPPORTED_ASSETS`` if all meshes together are too large.
        """
        if filename not in self._meshes:
            self._meshes[filename] = self._read_mesh(filename)
            if (count := sum(map(len, self._meshes.values()))) > _MOST_TRIANGLES:
                raise RequestError("UNSUPPORTED_ASSETS", f"{count} triangles in all; at most {_MOST_TRIANGLES}")
        return list(self._meshes).index(filename)


class _Joint(NamedTuple):
    """One joint; `element` is what is written for the physics engine."""

    name: str
    kind: str
    parent: str
    child: str
    element: ElementTree.Element


def _read_mass(link: ElementTree.Element) -> float:
    mass = link.find("inertial/mass")
    if mass is None:
        return 0.0
    (value,) = _read_numbers(mass, "value", 1, of=link)
    if value < 0:
        raise _malformed(f"link {_read_name(link)}: mass should not be negative, got {value:g} kg")
    return value


def _read_joint(joint: ElementTree.Element) -> _Joint:
    name = _read_name(joint)
    kind = joint.get("type", "")
    if kind not in ("fixed", "revolute", "continuous", "prismatic"):
        raise _malformed(f"joint {name}: joints of type {kind!r:.40} are not simulated")
    clean = ElementTree.Element("joint", name=name, type=kind)
    ends = {}
    for end in ("parent", "child"):
        element = joint.find(end)
        if element is None or not (link := element.get("link")):
            raise _malformed(f"joint {name}: it has no {end}")
        ElementTree.SubElement(clean, end, link=link)
        ends[end] = link
    clean.append(_write_origin(joint, of=joint))
    if kind != "fixed":
        _add_motion(clean, joint)
    return _Joint(name, kind, ends["parent"], ends["child"], clean)


def _find_rigid_links(links: Collection[str], joints: Sequence[_Joint]) -> list[str]:
    """Find the root of the tree of links, and then all links that are rigidly connected to it.

    Raises:
        RequestError: ``RESOURCE_PARSE_ERROR`` if the joints do not connect all links to one tree.
    """
    carriers: dict[str, _Joint] = {}
    names = set()
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise _malformed(f"joint {joint.name}: there is no link {link:.80}")
        if joint.name in names:
            raise _malformed(f"joint {joint.name} is there twice")
        if joint.child in carriers:
            raise _malformed(f"link {joint.child} hangs on two joints: {carriers[joint.child].name} and {joint.name}")
        names.add(joint.name)
        carriers[joint.child] = joint
    roots = [link for link in links if link not in carriers]
    if len(roots) > 1:
        raise _malformed(f"links {roots[0]} and {roots[1]} are not connected")
    # Without a root, each link hangs on another link, and the sorter below finds the ring.
    rigid = roots
    try:
        # Parents come before the links that they carry.
        for link in TopologicalSorter({child: [joint.parent] for child, joint in carriers.items()}).static_order():
            if link in carriers and carriers[link].kind == "fixed" and carriers[link].parent in rigid:
                rigid.append(link)
    except CycleError as error:
        raise _malformed("the joints form a ring") from error
    return rigid


def _add_motion(clean: ElementTree.Element, joint: ElementTree.Element) -> None:
    """Add axis, limits and damping of a joint that moves.

    Raises:
        RequestError: ``RESOURCE_PARSE_ERROR`` if the joint has no axis or limit, or contradictory limits.
    """
    name = clean.get("name")
    axis_element, limit = joint.find("axis"), joint.find("limit")
    axis = [1.0, 0.0, 0.0] if axis_element is None else _read_numbers(axis_element, "xyz", 3, of=joint)
    if (length := float(np.linalg.norm(axis))) < _LEAST_AXIS:
        raise _malformed(f"joint {name}: its axis {axis} has no direction")
    ElementTree.SubElement(clean, "axis", xyz=_format_numbers([value / length for value in axis]))
    if limit is None and clean.get("type") != "continuous":
        raise _malformed(f"joint {name}: it has no limit")
    if limit is not None:
        # Some descriptions write infinity where there is no limit. `_format_numbers` replaces it by the largest number
        # that an engine gets.
        values = {key: _read_numbers(limit, key, 1, of=joint, default=[0.0], largest=math.inf)[0] for key in _LIMITS}
        if values["lower"] > values["upper"] or values["effort"] < 0 or values["velocity"] < 0:
            raise _malformed(f"joint {name}: its limits contradict each other: {values}")
        ElementTree.SubElement(clean, "limit", {key: _format_numbers([value]) for key, value in values.items()})
    if (dynamics := joint.find("dynamics")) is not None:
        (damping,) = _read_numbers(dynamics, "damping", 1, of=joint, default=[0.0])
        ElementTree.SubElement(clean, "dynamics", damping=repr(max(damping, 0.0)))


_LIMITS = ("lower", "upper", "effort", "velocity")


def _read_name(element: ElementTree.Element) -> str:
    name = element.get("name", "")
    if not (1 <= len(name) <= _LONGEST_NAME and name.isprintable()):
        raise _malformed(
            f"a {element.tag} is called {name!r:.80}; wanted a printable name of at most {_LONGEST_NAME} characters"
        )
    return name


def _read_numbers(
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
    if len(values) != count or not all(abs(value) <= largest for value in values):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise _malformed(f"{of.tag} {_read_name(of)}: {element.tag} {key} should be {wanted}, got {text!r:.80}")
    return values


def _write_origin(element: ElementTree.Element, *, of: ElementTree.Element) -> ElementTree.Element:
    origin = element.find("origin")
    clean = ElementTree.Element("origin")
    for key in ("xyz", "rpy"):
        values = [0.0] * 3 if origin is None else _read_numbers(origin, key, 3, of=of, default=[0.0] * 3)
        clean.set(key, _format_numbers(values))
    return clean


def _write_inertia(link: ElementTree.Element, mass: float) -> dict[str, str]:
    least = mass * _LEAST_RADIUS_OF_GYRATION_M**2
    matrix: NDArray[np.float64] = np.zeros((3, 3))
    if (given := link.find("inertial/inertia")) is not None:
        for key, (row, column) in _INERTIA.items():
            (matrix[row, column],) = (matrix[column, row],) = _read_numbers(given, key, 1, of=link, default=[0.0])
    moments, axes = np.linalg.eigh(matrix)
    if moments[0] < -max(least, _ROUNDING * moments[2]):
        raise _malformed(f"link {_read_name(link)}: its inertia is not positive: principal moment {moments[0]:g} kg m²")
    possible = np.maximum(moments, least)
    # No body has a moment larger than the other two together. Given such a moment, Bullet would drop the whole inertia.
    possible[2] = min(possible[2], _LARGEST_SHARE * (possible[0] + possible[1]))
    if (possible != moments).any():
        matrix = axes * possible @ axes.T
    return {key: repr(float(matrix[place])) for key, place in _INERTIA.items()}


_INERTIA = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def _format_numbers(values: list[float]) -> str:
    return " ".join(repr(min(max(value, -_LARGEST_NUMBER), _LARGEST_NUMBER)) for value in values)
