"""The bodies of a scene as values, from their sections of the configuration: for engines, and how they look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.scene import AnyBody, BoxConfig, CylinderConfig
from throwcollect.config.schema import Config
from throwcollect.engines.body import HERE, BodyLink, LinkInertia, LinkShape, Placement, Vector, moments_of
from throwcollect.engines.engine import SceneBody

Outline = tuple[tuple[float, float], ...]
"""Corners of a polygon [m], counter-clockwise."""

_ROUND = 24
"""Number of corners with which a circle is drawn."""
_DIGITS = 4
"""Digits of corners [m]: tenths of millimetres."""


def bodies_of(config: Config) -> tuple[SceneBody, ...]:
    """Make the bodies that stand in the world of a trial: those of the scene, and those of the task."""
    return tuple(_make_body(name, section) for name, section in _find_sections(config).items())


@dataclass(frozen=True)
class BodyLook:
    """How a body of the scene looks.

    Attributes:
        name: Its name.
        shape: ``box``, ``cylinder`` along its own z, or ``sphere``.
        size_m: Edges of the box, or of the box around a cylinder or sphere, along its own axes [m].
        position_m: Its centre in world [m].
        rpy_rad: Rotations about the axes x, y, z of the world, in this order [rad].
        color: ``#rrggbb``.
        above_m: Its outline as seen from above: x and y in world [m].
        side_m: Its outline as seen from the right of the robot: x and z in world [m].
    """

    name: str
    shape: str
    size_m: Vector
    position_m: Vector
    rpy_rad: Vector
    color: str
    above_m: Outline
    side_m: Outline


def looks_of(config: Config) -> tuple[BodyLook, ...]:
    """Describe how the bodies in the world of a trial look."""
    looks = []
    for body, section in zip(bodies_of(config), _find_sections(config).values(), strict=True):
        (shape,), (place, turn) = body.link.shapes, body.placement
        size = shape.size
        if shape.kind != "box":
            radius, *length = size
            size = (2 * radius, 2 * radius, *(length or [2 * radius]))
        points = _find_corners(shape.kind, np.array(size)) @ _make_rotation(*turn).T + place
        x, y, z = size
        above, side = (_find_outline(points[:, axes]) for axes in ([0, 1], [0, 2]))
        looks.append(BodyLook(body.link.name, shape.kind, (x, y, z), place, turn, section.color, above, side))
    return tuple(looks)


def _find_sections(config: Config) -> Mapping[str, AnyBody]:
    return {**config.scene.bodies, **config.task.bodies}


def _find_corners(kind: str, size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find points of a shape whose hull is the shape or nearly so, in its own frame [m], shape ``(n, 3)``."""
    angles = np.arange(_ROUND) * 2 * np.pi / _ROUND
    circle, ends = np.column_stack([np.cos(angles), np.sin(angles)]), np.array([-1.0, 1.0])
    if kind == "box":
        corners = np.stack(np.meshgrid(ends, ends, ends), axis=-1).reshape(-1, 3)
    elif kind == "cylinder":
        corners = np.concatenate([np.column_stack([circle, np.full(_ROUND, end)]) for end in ends])
    else:
        # Parallels of the sphere, each as high as a corner of the circle.
        corners = np.concatenate([np.column_stack([abs(r) * circle, np.full(_ROUND, z)]) for r, z in circle])
    return corners * size / 2


def _make_rotation(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Make the matrix of rotations about the fixed axes x, y, z in this order, shape ``(3, 3)``."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    matrix: NDArray[np.float64] = about_z @ about_y @ about_x
    return matrix


def _find_outline(points: NDArray[np.float64]) -> Outline:
    """Find the corners of the hull of points [m], shape ``(n, 2)``: those that are outermost in some direction."""
    # None of the directions is that of an edge whose ends would be equally far, such as those of an upright box.
    angles = np.radians(np.arange(720) / 2 + 0.1)
    outermost = np.argmax(points @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
    corners = [(round(x, _DIGITS), round(y, _DIGITS)) for x, y in points[outermost].tolist()]
    return tuple(dict.fromkeys(corners))


def _make_body(name: str, section: AnyBody) -> SceneBody:
    size: tuple[float, ...] = (section.radius_m,) if not isinstance(section, BoxConfig) else tuple(section.size_m)
    if isinstance(section, CylinderConfig):
        size = (section.radius_m, section.length_m)
    inertia = None
    if section.mass_kg is not None:
        x, y, z = moments_of(section.shape, size, section.mass_kg)
        inertia = LinkInertia(section.mass_kg, HERE, (x, 0.0, 0.0, y, 0.0, z))
    link = BodyLink(name, inertia, (LinkShape(section.shape, size, HERE),))
    (x, y, z), (roll, pitch, yaw) = section.position_m, section.rpy_rad
    restitution = (1.0 if inertia is None else 0.0) if section.restitution is None else section.restitution
    return SceneBody(link, Placement((x, y, z), (roll, pitch, yaw)), section.friction, restitution)
