"""The object and the bodies of a scene as values, from their sections of the configuration, and how they look."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.scene import BALL, AnyBody, BoxConfig, CylinderConfig, SphereConfig
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
from throwcollect.reproducible_math import cos, matmul, sin

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
    ball = config.ball
    sphere = SphereConfig.model_construct(
        shape="sphere",
        radius_m=ball.radius_m,
        mass_kg=ball.mass_kg,
        friction=ball.friction,
        restitution=ball.restitution,
        rolling_friction_m=ball.rolling_friction_m,
        color=_BALL_COLOR,
    )
    return {**config.bodies, BALL: sphere}


@dataclass(frozen=True)
class BodyLook:
    """How a body looks.

    Attributes:
        name: Its name.
        shape: ``box``, ``cylinder`` along its own z, or ``sphere``.
        size_m: Edges of the box, or of the box around a cylinder or sphere, along its own axes [m].
        position_m: Its centre in world [m].
        rpy_rad: Rotations about the axes x, y, z of the world, in this order [rad].
        color: ``#rrggbb``.
        moves: Whether it moves when it is pushed; then its place and outlines are those at the start.
        above_m: Its outline as seen from above: x and y in world [m].
        side_m: Its outline as seen from the right of the robot: x and z in world [m].
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


def looks_of(config: Config) -> tuple[BodyLook, ...]:
    """Describe how the bodies in the world of a trial look, with the object last."""
    looks, sections = [], _list_sections(config)
    for name in sorted(sections, key=lambda name: name == config.acted_on):
        section, body = sections[name], _make_body(name, sections)
        (shape,), (place, turn) = body.link.shapes, body.placement
        size = shape.size
        if shape.kind != "box":
            radius, *length = size
            size = (2 * radius, 2 * radius, *(length or [2 * radius]))
        points = _turn(_find_corners(shape.kind, np.array(size)), turn) + place
        x, y, z = size
        above, side = (_find_outline(points[:, axes]) for axes in ([0, 1], [0, 2]))
        looks.append(BodyLook(name, shape.kind, (x, y, z), place, turn, section.color, body.moves, above, side))
    return tuple(looks)


def _find_corners(kind: str, size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find points of a shape whose hull is the shape or nearly so, in its own frame [m], shape ``(n, 3)``."""
    if kind == "box":
        return np.array(list(product([-1.0, 1.0], repeat=3))) * size / 2
    angles = np.arange(_ROUND) * 2 * np.pi / _ROUND
    circle = np.column_stack([cos(angles), sin(angles)])
    # A sphere is drawn by parallels, one as high as each corner of the circle.
    rings = circle if kind == "sphere" else np.array([(1.0, -1.0), (1.0, 1.0)])
    return np.concatenate([np.column_stack([abs(r) * circle, np.full(_ROUND, z)]) for r, z in rings]) * size / 2


def _turn(points: NDArray[np.float64], rpy_rad: Vector) -> NDArray[np.float64]:
    """Turn points, shape ``(n, 3)``, about the fixed axes x, y, z in this order."""
    turned = points.copy()
    for angle, (one, other) in zip(rpy_rad, ((1, 2), (2, 0), (0, 1)), strict=True):
        u, v = turned[:, [one, other]].T
        turned[:, one] = math.cos(angle) * u - math.sin(angle) * v
        turned[:, other] = math.sin(angle) * u + math.cos(angle) * v
    return turned


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
    section = sections[name]
    size: tuple[float, ...] = (section.radius_m,) if not isinstance(section, BoxConfig) else tuple(section.size_m)
    if isinstance(section, CylinderConfig):
        size = (section.radius_m, section.length_m)
    inertia = None
    if section.mass_kg is not None:
        x, y, z = moments_of(section.shape, size, section.mass_kg)
        inertia = LinkInertia(section.mass_kg, HERE, (x, 0.0, 0.0, y, 0.0, z))
    link = BodyLink(name, inertia, (LinkShape(section.shape, size, HERE),))
    (x, y, z), (roll, pitch, yaw), (vx, vy, vz) = section.position_m, section.rpy_rad, section.velocity_mps
    place = Placement((x, y, z), (roll, pitch, yaw))
    if section.lies_on is not None and section.lies_on in sections:
        below = _make_body(section.lies_on, sections)
        middle, top = below.placement.xyz, _reach_up(below.link.shapes[0], below.placement)
        rise = middle[2] + top + _reach_up(link.shapes[0], place)
        place = Placement((middle[0] + x, middle[1] + y, rise + z), place.rpy)
    restitution = (1.0 if inertia is None else 0.0) if section.restitution is None else section.restitution
    return SceneBody(link, place, section.friction, restitution, section.rolling_friction_m, (vx, vy, vz))


def _reach_up(shape: LinkShape, placement: Placement) -> float:
    """Compute how far a shape reaches above its centre [m]."""
    x, y, z, w = turn_of(placement)
    # The vertical of the world along the axes of the body.
    up = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    match shape.kind, shape.size:
        case "box", edges:
            return sum(abs(axis) * edge for axis, edge in zip(up, edges, strict=True)) / 2
        case "cylinder", (radius, length):
            return abs(up[2]) * length / 2 + math.hypot(up[0], up[1]) * radius
    return shape.size[0]
