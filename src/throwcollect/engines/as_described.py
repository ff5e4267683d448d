"""Compares the robot that an engine has loaded with the values that it was given.

Engines drop or change what they cannot use, and go on: shapes, inertias, limits.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import INERTIA, BodyJoint, LinkShape, Placement
from throwcollect.engines.engine import Box, Engine, LoadedLink, Scene
from throwcollect.errors import ConfigError

Array = NDArray[np.float64]

_PLACE_M = 1e-4
_SHARE = 1e-3
"""Largest relative difference of masses and inertias; engines diagonalise inertias by iteration."""
_ANGLE = 1e-4
_SMALLER_M, _LARGER_M, _LARGER = 1e-3, 0.02, 2.0
"""How much smaller the box around the shapes of a link may be, and how much larger, also as a share of its diagonal:
engines add margins, and enclose boxes that are turned."""


def check_loaded(engine: Engine, name: str, scene: Scene) -> None:
    """Make sure that an engine has loaded the robot of a scene as it is described, right after `Engine.load`.

    Args:
        engine: The engine.
        name: Its name, for messages.
        scene: The scene that it has loaded.
    """
    if (loaded := engine.describe_robot()) is None:
        return
    found = {link.name: link for link in loaded}
    for wanted in _describe(scene):
        if (differing := _find_difference(found.get(wanted.name), wanted)) is not None:
            raise ConfigError(
                f"{scene.robot.name}: link {wanted.name}: the engine {name} has {differing}",
                hint="correct the link in a copy of the URDF, or choose another sim.engine",
            )


def _find_difference(found: LoadedLink | None, wanted: LoadedLink) -> str | None:
    """Say what is different; None if nothing is. The mass of links that never move does not matter."""
    if found is None:
        return "no such link"
    if found.shapes != wanted.shapes:
        return f"{found.shapes} of its {wanted.shapes} collision shapes"
    if wanted.box is not None and found.box is not None:
        (low, high), (wanted_low, wanted_high) = np.array(found.box), np.array(wanted.box)
        is_smaller = max((low - wanted_low).max(), (wanted_high - high).max()) > _SMALLER_M
        if is_smaller or (high - low).max() > _LARGER * np.linalg.norm(wanted_high - wanted_low) + _LARGER_M:
            return f"collision shapes of another extent: {_round(found.box)} m instead of {_round(wanted.box)} m"
    if wanted.axis is not None and (found.axis is None or np.abs(found.axis - wanted.axis).max() > _ANGLE):
        return f"another joint axis: {found.axis}, not {wanted.axis}"
    if wanted.range is not None and (found.range is None or not np.allclose(found.range, wanted.range, rtol=1e-6)):
        return f"other limits of its joint: {found.range}, not {wanted.range}"
    if wanted.mass_kg and abs(found.mass_kg - wanted.mass_kg) > _SHARE * wanted.mass_kg:
        return f"a mass of {found.mass_kg:.6g} kg, not {wanted.mass_kg:.6g} kg"
    if wanted.mass_kg and np.abs(found.centre - wanted.centre).max() > _PLACE_M:
        return f"its centre of mass at {found.centre}, not {wanted.centre}"
    if wanted.mass_kg and np.abs(found.inertia - wanted.inertia).max() > _SHARE * np.abs(wanted.inertia).max():
        moments = (np.linalg.eigvalsh(each.inertia) for each in (found, wanted))
        return "principal moments of inertia of {} kg m², not {} kg m²".format(*moments)
    return None


def _round(box: object) -> list[list[float]]:
    rounded: list[list[float]] = np.round(np.array(box), 3).tolist()
    return rounded


def _describe(scene: Scene) -> Iterator[LoadedLink]:
    """Describe the links of a scene with all joints at 0, in the order from the root outwards."""
    above = {joint.child: joint for joint in scene.robot.joints}
    links = {link.name: link for link in scene.robot.links}
    frames: dict[str, tuple[Array, Array]] = {
        scene.robot.links[0].name: (np.array([0.0, 0.0, scene.base_height_m]), np.eye(3))
    }
    moves: dict[str, bool] = {scene.robot.links[0].name: False}

    def place(name: str) -> tuple[Array, Array]:
        if name not in frames:
            joint = above[name]
            frames[name] = _compose(place(joint.parent), joint.placement)
            moves[name] = moves[joint.parent] or joint.moves
        return frames[name]

    for name, link in links.items():
        frame, joint = place(name), above.get(name)
        inertia = link.inertia
        centre, axes = _compose(frame, inertia.placement if inertia else Placement())
        matrix = np.zeros((3, 3))
        if inertia is not None:
            for value, (row, column) in zip(inertia.moments_kgm2, INERTIA.values(), strict=True):
                matrix[row, column] = matrix[column, row] = value
        corners = [_find_extent(_compose(frame, shape.placement), shape) for shape in link.shapes]
        yield LoadedLink(
            name=name,
            mass_kg=inertia.mass_kg if inertia and moves[name] else 0.0,
            centre=centre,
            inertia=axes @ matrix @ axes.T,
            shapes=len(link.shapes),
            box=_enclose(corners) if corners else None,
            axis=_direction(frame, joint),
            range=joint.limits[:2] if joint and joint.limits else None,
        )


def _direction(frame: tuple[Array, Array], joint: BodyJoint | None) -> Array | None:
    if joint is None or not joint.moves:
        return None
    axis = np.array(joint.axis)
    direction: Array = frame[1] @ axis / np.linalg.norm(axis)
    return direction


def _compose(frame: tuple[Array, Array], placement: Placement) -> tuple[Array, Array]:
    """Find the frame that is placed in another one: its origin and its rotation."""
    (origin, rotation), (roll, pitch, yaw) = frame, placement.rpy
    (sr, cr), (sp, cp), (sy, cy) = ((np.sin(angle), np.cos(angle)) for angle in (roll, pitch, yaw))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return origin + rotation @ np.array(placement.xyz), rotation @ turn


def _find_extent(frame: tuple[Array, Array], shape: LinkShape) -> tuple[Array, Array]:
    """Find lowest and highest corner of a shape, along the axes of the world."""
    origin, rotation = frame
    if shape.mesh is not None:
        points = (shape.mesh.triangles.reshape(-1, 3) * np.array(shape.size)) @ rotation.T + origin
        return points.min(axis=0), points.max(axis=0)
    if shape.kind == "box":
        half = np.abs(rotation) @ np.array(shape.size) / 2
    else:
        radius, *length = shape.size
        upright = np.abs(rotation[:, 2])
        # A cylinder ends with discs, and a capsule with half spheres.
        across = radius * np.sqrt(np.maximum(1 - upright**2, 0)) if shape.kind == "cylinder" else radius
        half = upright * (length[0] if length else 0.0) / 2 + across
    return origin - half, origin + half


def _enclose(corners: list[tuple[Array, Array]]) -> Box:
    lows, highs = zip(*corners, strict=True)
    (x, y, z), (far_x, far_y, far_z) = np.min(lows, axis=0).tolist(), np.max(highs, axis=0).tolist()
    return (x, y, z), (far_x, far_y, far_z)
