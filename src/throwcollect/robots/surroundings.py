"""The object and the bodies of a scene as values, from their sections of the configuration, and how they look."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.scene import BALL, AnyBody, BallConfig, BoxConfig, CylinderConfig, FileBodyConfig, SphereConfig
from throwcollect.config.schema import Config
from throwcollect.engines.body import (
    HERE,
    BodyLink,
    LinkInertia,
    LinkShape,
    Placement,
    Vector,
    moments_of,
    turn_of,
)
from throwcollect.engines.engine import SceneBody
from throwcollect.engines.mesh import Mesh
from throwcollect.engines.pose import Pose
from throwcollect.reproducible_math import cos, matmul, sin
from throwcollect.robots.body_files import inertia_of, shapes_of

Outline = tuple[tuple[float, float], ...]
"""Corners of a polygon [m], counter-clockwise, to tenths of millimetres."""

_ROUND = 24
"""Number of corners with which a circle is drawn."""
_BALL_COLOR = "#ff7300"


def object_of(config: Config) -> SceneBody:
    """Make the object that the robot acts on in a trial: the ball, or a body of the scene or of the task."""
    return _make_body(config.acted_on, _list_sections(config))


def bodies_of(config: Config) -> tuple[SceneBody, ...]:
    """Make the other bodies that stand in the world of a trial: those of the scene, and those of the task."""
    sections = _list_sections(config)
    return tuple(_make_body(name, sections) for name in sections if name != config.acted_on)


def starts_in_tool(config: Config) -> bool:
    """Whether the object lies in the tool at the start of a trial, or is held by it."""
    return config.acted_on == BALL or _list_sections(config)[config.acted_on].lies_on == config.tool.name


def moving_bodies_of(config: Config) -> tuple[str, ...]:
    """Name all that moves besides the robot: the object, and then the other bodies in the order of samples."""
    sections = config.bodies.items()
    others = (name for name, section in sections if section.mass_kg is not None and name != config.acted_on)
    return (config.acted_on, *others)


def _list_sections(config: Config) -> Mapping[str, AnyBody]:
    """List the sections of all bodies by name; the ball, if there is one, is a sphere."""
    if config.acted_on != BALL:
        return config.bodies
    return {**config.bodies, BALL: _describe_ball(config.ball)}


@lru_cache(maxsize=64)
def _describe_ball(ball: BallConfig) -> SphereConfig:
    return SphereConfig.model_construct(
        shape="sphere",
        radius_m=ball.radius_m,
        mass_kg=ball.mass_kg,
        friction=ball.friction,
        restitution=ball.restitution,
        rolling_friction_m=ball.rolling_friction_m,
        color=_BALL_COLOR,
    )


@dataclass(frozen=True)
class BodyLook:
    """How a shape of a body looks.

    Attributes:
        name: Name of the body.
        shape: ``box``, ``cylinder`` along its own z, ``sphere`` or ``mesh``.
        size_m: Edges of the box, or of the box around a cylinder or sphere, along its own axes [m]; factors on the
            coordinates of a mesh.
        position_m: Origin of the body in world [m]; for a body of one shape that is no mesh, its centre.
        rpy_rad: Rotations about the axes x, y, z of the world, in this order [rad].
        color: ``#rrggbb``.
        moves: Whether it moves when it is pushed; then its place and outlines are those at the start.
        above_m: Outline of the shape as seen from above: x and y in world [m].
        side_m: Its outline as seen from the right of the robot: x and z in world [m].
        within: Pose of the shape in the body: position [m], and rotations as `rpy_rad`.
        mesh: File of the mesh; empty if it is none.
    """

    name: str
    shape: str
    size_m: Vector
    position_m: Vector
    rpy_rad: Vector
    color: str
    moves: bool
    above_m: Outline
    side_m: Outline
    within: Placement = HERE
    mesh: str = ""


def looks_of(config: Config) -> tuple[BodyLook, ...]:
    """Describe how the shapes of bodies in the world of a trial look, one body after the other, the object last."""
    looks, sections = [], _list_sections(config)
    for name in sorted(sections, key=lambda name: name == config.acted_on):
        section = sections[name]
        placement = _find_placement(section, sections)
        for shape in _make_shapes(section):
            size = shape.size
            if shape.kind in ("cylinder", "sphere"):
                radius, *length = size
                size = (2 * radius, 2 * radius, *(length or [2 * radius]))
            points = _place(_place(_find_corners(shape, np.array(size)), shape.placement), placement)
            x, y, z = size
            above, side = (_find_outline(points[:, axes]) for axes in ([0, 1], [0, 2]))
            pose, mesh = (*placement, section.color, section.mass_kg is not None), shape.mesh
            file = "" if mesh is None else str(mesh.path)
            looks.append(BodyLook(name, shape.kind, (x, y, z), *pose, above, side, shape.placement, file))
    return tuple(looks)


def _find_corners(shape: LinkShape, size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find points of a shape whose hull is the shape or nearly so, in its own frame [m], shape ``(n, 3)``."""
    kind = shape.kind
    if shape.mesh is not None:
        return _find_outermost(shape.mesh) * size
    if kind == "box":
        return np.array(list(product([-1.0, 1.0], repeat=3))) * size / 2
    angles = np.arange(_ROUND) * 2 * np.pi / _ROUND
    circle = np.column_stack([cos(angles), sin(angles)])
    # A sphere is drawn by parallels, one as high as each corner of the circle.
    rings = circle if kind == "sphere" else np.array([(1.0, -1.0), (1.0, 1.0)])
    return np.concatenate([np.column_stack([abs(r) * circle, np.full(_ROUND, z)]) for r, z in rings]) * size / 2


@lru_cache(maxsize=64)
def _find_outermost(mesh: Mesh) -> NDArray[np.float64]:
    """Choose the corners of a mesh that are outermost in some of many directions, shape ``(n, 3)``."""
    # Both ends of lines to the points of a grid on half of a cube.
    grid = np.array(list(product(np.linspace(-1.0, 1.0, 8), repeat=2)))
    lines = np.concatenate([np.insert(grid, axis, 1.0, axis=1) for axis in range(3)])
    along = (matmul(mesh.corners, line.reshape(3, 1)) for line in lines)
    ends = np.unique([(each.argmin(), each.argmax()) for each in along])
    return np.take(mesh.corners, ends, axis=0)


def _place(points: NDArray[np.float64], placement: Placement) -> NDArray[np.float64]:
    """Find points of a frame in its parent, shape ``(n, 3)``."""
    rows = Pose.of(placement.xyz, turn_of(placement)).rows
    return matmul(points, np.array(rows).T) + placement.xyz


@cache
def _make_directions() -> NDArray[np.float64]:
    """Make directions all around, two degrees apart, shape ``(2, n)``; none is that of an edge of an upright box."""
    angles = np.radians(np.arange(0.1, 360, 2))
    return np.stack([cos(angles), sin(angles)])


def _find_outline(points: NDArray[np.float64]) -> Outline:
    """Find the corners of the hull of points [m], shape ``(n, 2)``: those that are outermost in some direction."""
    outermost = np.argmax(matmul(points, _make_directions()), axis=0)
    corners = [(round(x, 4), round(y, 4)) for x, y in points[outermost].tolist()]
    return tuple(dict.fromkeys(corners))


def _make_body(name: str, sections: Mapping[str, AnyBody]) -> SceneBody:
    section, inertia = sections[name], None
    shapes = _make_shapes(section)
    if section.mass_kg is not None:
        if isinstance(section, FileBodyConfig):
            inertia = inertia_of(section, section.mass_kg)
        else:
            x, y, z = moments_of(section.shape, shapes[0].size, section.mass_kg)
            inertia = LinkInertia(section.mass_kg, HERE, (x, 0.0, 0.0, y, 0.0, z))
    restitution = (1.0 if inertia is None else 0.0) if section.restitution is None else section.restitution
    place, (vx, vy, vz) = _find_placement(section, sections), section.velocity_mps
    link = BodyLink(name, inertia, shapes)
    return SceneBody(link, place, section.friction, restitution, section.rolling_friction_m, (vx, vy, vz))


def _make_shapes(section: AnyBody) -> tuple[LinkShape, ...]:
    if isinstance(section, FileBodyConfig):
        return shapes_of(section)
    size: tuple[float, ...] = (section.radius_m,) if not isinstance(section, BoxConfig) else tuple(section.size_m)
    if isinstance(section, CylinderConfig):
        size = (section.radius_m, section.length_m)
    return (LinkShape(section.shape, size, HERE),)


def _find_placement(section: AnyBody, sections: Mapping[str, AnyBody]) -> Placement:
    (x, y, z), (roll, pitch, yaw) = section.position_m, section.rpy_rad
    place = Placement((x, y, z), (roll, pitch, yaw))
    if section.lies_on is None or section.lies_on not in sections:
        return place
    below = sections[section.lies_on]
    middle = _find_placement(below, sections)
    top = max(_reach(shape, _turn_back((0.0, 0.0, 1.0), middle)) for shape in _make_shapes(below))
    bottom = max(_reach(shape, _turn_back((0.0, 0.0, -1.0), place)) for shape in _make_shapes(section))
    rise = middle.xyz[2] + top + bottom
    return Placement((middle.xyz[0] + x, middle.xyz[1] + y, rise + z), place.rpy)


def _turn_back(direction: Vector, placement: Placement) -> Vector:
    """Write a direction of a parent along the axes of a frame in it."""
    return Pose.of(placement.xyz, turn_of(placement)).inverse().turn(direction)


def _reach(shape: LinkShape, direction: Vector) -> float:
    """Compute how far a shape of a body reaches in a direction, from the origin of the body [m]."""
    from_origin = sum(one * other for one, other in zip(direction, shape.placement.xyz, strict=True))
    along = _turn_back(direction, shape.placement)
    if shape.mesh is not None:
        return from_origin + float(matmul(shape.mesh.corners * shape.size, np.array(along).reshape(3, 1)).max())
    match shape.kind, shape.size:
        case "box", edges:
            return from_origin + sum(abs(axis) * edge for axis, edge in zip(along, edges, strict=True)) / 2
        case "cylinder", (radius, length):
            return from_origin + abs(along[2]) * length / 2 + math.hypot(along[0], along[1]) * radius
    return from_origin + shape.size[0]
