"""Turns descriptions of objects, which clients send, into bodies that an engine takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import INERTIA, BodyJoint, BodyLink, BodyModel, LinkInertia, Placement
from throwcollect.errors import ConfigError, RequestError
from throwcollect.robots.urdf import parse_xml, read_urdf

_MOST_LINKS = 128
"""Bullet takes no more links."""

_MOST_TRIANGLES = 400_000
_LARGEST_NUMBER = 1e6
_LEAST_MASS_KG = 1e-3
"""Mass of links that have none, such as frames of sensors: Bullet would take one kilogram."""

_LEAST_RADIUS_OF_GYRATION_M = 1e-3
_ROUNDING = 0.1
"""How negative a principal moment may be, as a share of the largest one; the numbers of descriptions are rounded."""

_LARGEST_SHARE = 0.999


def read_model(content: str | bytes, find_mesh: Callable[[str], Path], *, load_meshes: bool = True) -> BodyModel:
    """Read and check a description.

    Args:
        content: URDF text, or the bytes of a file.
        find_mesh: Finds the file of a mesh by its ``filename``; may raise a `RequestError`.
        load_meshes: Whether meshes are read, too; otherwise they are only looked for.
    """
    reason = "RESOURCE_PARSE_ERROR"
    try:
        root = parse_xml(content, "description")
        if root.tag != "robot":
            reason = "UNSUPPORTED_FORMAT"
        model = read_urdf(root, "description", find_mesh=find_mesh).model
    except ConfigError as error:
        raise RequestError(reason, error.message) from error
    if len(model.links) > _MOST_LINKS:
        raise _malformed(f"{len(model.links)} links; 1 to {_MOST_LINKS} can be simulated")
    if others := [joint for joint in model.joints if joint.kind in ("floating", "planar")]:
        raise _malformed(f"joint {others[0].name}: joints of type {others[0].kind!r} are not simulated")
    try:
        for mesh in model.meshes:
            mesh.check()
        if load_meshes and (count := sum(len(mesh.triangles) for mesh in model.meshes)) > _MOST_TRIANGLES:
            raise RequestError("UNSUPPORTED_ASSETS", f"{count} triangles in all; at most {_MOST_TRIANGLES}")
    except ConfigError as error:
        raise RequestError("UNSUPPORTED_ASSETS", error.message, expected=error.expected) from error
    masses = {link.name: link.inertia.mass_kg if link.inertia else 0.0 for link in model.links}
    rigid = _find_rigid_links(model)
    # URDF has no word for a body that is attached to the world: such a description calls its root `world`, or gives it
    # no mass.
    is_fixed = model.links[0].name == "world" or sum(masses[name] for name in rigid) == 0
    links = tuple(_complete(link, exact=is_fixed and link.name in rigid) for link in model.links)
    return replace(model, links=links, joints=tuple(map(_clip, model.joints)), is_fixed=is_fixed)


def _malformed(message: str) -> RequestError:
    return RequestError("RESOURCE_PARSE_ERROR", message)


def _find_rigid_links(model: BodyModel) -> set[str]:
    """Find the root, and all links that are rigidly connected to it."""
    rigid: set[str] = set()
    found = {model.links[0].name}
    while found:
        rigid |= found
        found = {joint.child for joint in model.joints if not joint.moves and joint.parent in found}
    return rigid


def _complete(link: BodyLink, *, exact: bool) -> BodyLink:
    """Give a link a possible inertia, and its exact meshes if it never moves; all others become their convex hulls."""
    given = link.inertia or LinkInertia(0.0, Placement(), (0.0,) * len(INERTIA))
    mass = max(given.mass_kg, _LEAST_MASS_KG)
    shapes = tuple(replace(shape, is_concave=exact and shape.mesh is not None) for shape in link.shapes)
    moments = _correct(link.name, given.moments_kgm2, mass)
    return BodyLink(link.name, LinkInertia(mass, given.placement, moments), shapes)


def _correct(link: str, moments: tuple[float, ...], mass: float) -> tuple[float, ...]:
    """Find the nearest inertia that a body of this mass can have."""
    least = mass * _LEAST_RADIUS_OF_GYRATION_M**2
    matrix: NDArray[np.float64] = np.zeros((3, 3))
    for value, (row, column) in zip(moments, INERTIA.values(), strict=True):
        matrix[row, column] = matrix[column, row] = value
    principal, axes = np.linalg.eigh(matrix)
    if principal[0] < -max(least, _ROUNDING * principal[2]):
        raise _malformed(f"link {link}: its inertia is not positive: principal moment {principal[0]:g} kg m²")
    possible = np.maximum(principal, least)
    # No body has a moment larger than the other two together. Given such a moment, Bullet would drop the whole inertia.
    possible[2] = min(possible[2], _LARGEST_SHARE * (possible[0] + possible[1]))
    if (possible != principal).any():
        matrix = axes * possible @ axes.T
    return tuple(float(matrix[place]) for place in INERTIA.values())


def _clip(joint: BodyJoint) -> BodyJoint:
    """Replace infinite limits, which some descriptions have, by the largest numbers that an engine gets."""
    if joint.limits is None:
        return joint
    lower, upper, velocity, effort = (min(max(each, -_LARGEST_NUMBER), _LARGEST_NUMBER) for each in joint.limits)
    return replace(joint, limits=(lower, upper, velocity, effort))
