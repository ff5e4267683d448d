"""Bodies of a scene whose shapes are in files: a mesh, or a URDF of one rigid body."""

from __future__ import annotations

import hashlib
import math
import xml.etree.ElementTree as ElementTree
from collections import ChainMap
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from throwcollect.config.scene import BodyConfig, FileBodyConfig, MeshConfig
from throwcollect.engines.body import HERE, BodyLink, BodyModel, LinkInertia, LinkShape, to_text
from throwcollect.engines.engine import BodyState, SceneBody
from throwcollect.engines.mesh import Mesh
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError
from throwcollect.robots.imported import find_mesh
from throwcollect.robots.joint_model import check_moments, describe_inertia, placement_of, pose_of
from throwcollect.robots.urdf import parse_xml, read_urdf, read_xml

_LARGEST_M = 20.0
_NAME = "body"
"""Name of the body, and of its only link, in the URDF that a dataset carries."""
_SPAWNED = Path("resource_string")


class BodyFile(NamedTuple):
    """What a file describes: shapes, a mesh without a scale, and the inertia of a URDF that has one.

    `files` are those that a dataset carries for it, by name. The first describes the body, also by the digests of the
    others; `sha256` is its digest in hexadecimal.
    """

    link: BodyLink
    files: Mapping[str, bytes]
    sha256: str


def complete(section: FileBodyConfig) -> FileBodyConfig:
    """Complete the section of a body, whose file is read, unless it has a digest: that of a dataset's own file."""
    if section.sha256 is not None:
        return section
    made = section.model_copy(update={"sha256": _read(type(section), section.file).sha256})
    for shape in shapes_of(made):
        extents = np.ptp(shape.mesh.corners * shape.size, axis=0) if shape.mesh else np.zeros(3)
        if (extent := float(extents.max())) > _LARGEST_M:
            hint = "a mesh in millimetres has the scale [0.001, 0.001, 0.001]"
            raise ConfigError(f"{section.file}: {extent:g} m large", hint=hint)
    check_moments(f"{section.file}: its body", _to_spatial(inertia_of(made, 1.0)))
    return made


def files_of(section: FileBodyConfig) -> Mapping[str, bytes]:
    """Make the files that a dataset carries for a body, by name."""
    return _find(type(section), section.file, section.sha256).files


def shapes_of(section: FileBodyConfig) -> tuple[LinkShape, ...]:
    """Make the shapes of a body in its own frame."""
    shapes = _find(type(section), section.file, section.sha256).link.shapes
    if not isinstance(section, MeshConfig):
        return shapes
    return tuple(replace(shape, size=tuple(section.scale)) for shape in shapes)


def inertia_of(section: FileBodyConfig, mass_kg: float) -> LinkInertia:
    """Compute the inertia of a body of some mass: spread as that of its URDF, or evenly over its shapes."""
    found = _find(type(section), section.file, section.sha256).link.inertia
    if found is None or not found.mass_kg:
        found = _spread_evenly(shapes_of(section), section.sha256)
    moments = tuple(moment * mass_kg / found.mass_kg for moment in found.moments_kgm2)
    return LinkInertia(mass_kg, found.placement, moments)


@lru_cache(maxsize=64)
def _spread_evenly(shapes: tuple[LinkShape, ...], _sha256: str | None) -> LinkInertia:
    """Compute the inertia of shapes of 1 kg/m³; the digest distinguishes files that had the same name."""
    whole = pinocchio.Inertia.Zero()
    for shape in shapes:
        if shape.mesh is not None:
            hull = shape.mesh.find_hull(shape.size)
            moments = hull.computeMomentofInertiaRelatedToCOM()
            solid = pinocchio.Inertia(hull.computeVolume(), hull.computeCOM(), moments)
        elif shape.kind == "box":
            solid = pinocchio.Inertia.FromBox(math.prod(shape.size), *shape.size)
        elif shape.kind == "cylinder":
            radius, length = shape.size
            solid = pinocchio.Inertia.FromCylinder(math.pi * radius * radius * length, radius, length)
        else:
            (radius,) = shape.size
            solid = pinocchio.Inertia.FromSphere(4 / 3 * math.pi * radius * radius * radius, radius)
        whole += pose_of(shape.placement).act(solid)
    return describe_inertia(whole)


@lru_cache(maxsize=32)
def _find(kind: type[FileBodyConfig], file: str, sha256: str | None) -> BodyFile:
    """Read the file of a section, and make sure that it is the one of its digest, if it has one."""
    found = _read(kind, file)
    if sha256 not in (None, found.sha256):
        hint = "restore a dataset by throwcollect up CONFIG --resume DIR"
        raise ConfigError(f"{file}: is not the file of the body's sha256", hint=hint)
    return found


def _read(kind: type[FileBodyConfig], file: str) -> BodyFile:
    path = Path(file)
    if kind is not MeshConfig:
        return _read_body(read_xml(path), path, partial(find_mesh, urdf=path))
    mesh = Mesh(path)
    link = BodyLink(_NAME, None, (LinkShape("mesh", (1.0, 1.0, 1.0), HERE, mesh),))
    return BodyFile(link, *_pack(mesh.encode(), ".stl"))


def _read_body(root: ElementTree.Element, path: Path, find: Callable[[str], Path]) -> BodyFile:
    """Read the one rigid body of a URDF, with a function that finds its meshes."""
    model = read_urdf(root, str(path), find_mesh=find).model
    if model.moving:
        joint = model.moving[0]
        raise ConfigError(f"{path}: should be one rigid body, but its joint {joint.name} is {joint.kind}, not fixed")
    link = _merge(model)
    if not link.shapes or any(shape.kind == "capsule" for shape in link.shapes):
        raise ConfigError(f"{path}: should have collision shapes, of which none is a capsule")
    model = BodyModel(_NAME, (link,))
    robot = ElementTree.Element("robot", name=_NAME)
    robot.extend(model.to_xml())
    meshes = {name: _pack(content, ".stl")[0] for name, content in model.encode_meshes().items()}
    for mesh in robot.iter("mesh"):
        (filename,) = meshes[mesh.attrib["filename"]]
        mesh.set("filename", filename)
    files, sha256 = _pack(to_text(robot).encode(), ".urdf")
    return BodyFile(link, {**files, **ChainMap(*meshes.values())}, sha256)


def _pack(content: bytes, suffix: str) -> tuple[dict[str, bytes], str]:
    """Make a file that is named by its digest, and that digest."""
    sha256 = hashlib.sha256(content).hexdigest()
    return {f"{sha256[:16]}{suffix}": content}, sha256


def _merge(model: BodyModel) -> BodyLink:
    """Merge links that are fixed to each other into the first one, in whose frame the result is."""
    if len(model.links) == 1:
        # What a dataset carries is read as it is, and without the library of poses.
        return replace(model.links[0], name=_NAME)
    above = {joint.child: joint for joint in model.joints}

    def find_pose(link: str) -> pinocchio.SE3:
        joint = above.get(link)
        return pinocchio.SE3.Identity() if joint is None else find_pose(joint.parent) * pose_of(joint.placement)

    shapes, whole = [], pinocchio.Inertia.Zero()
    for link in model.links:
        pose = find_pose(link.name)
        for shape in link.shapes:
            shapes.append(replace(shape, placement=placement_of(pose * pose_of(shape.placement))))
        if link.inertia is not None:
            whole += pose.act(_to_spatial(link.inertia))
    return BodyLink(_NAME, describe_inertia(whole) if whole.mass else None, tuple(shapes))


def _to_spatial(inertia: LinkInertia) -> pinocchio.Inertia:
    xx, xy, xz, yy, yz, zz = inertia.moments_kgm2
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pose_of(inertia.placement).act(pinocchio.Inertia(inertia.mass_kg, np.zeros(3), matrix))


def read_spawned(urdf: str) -> SceneBody:
    """Make the one rigid body of a URDF text, which moves if it has a mass there; other keys have their defaults."""
    link = _read_body(parse_xml(urdf, str(_SPAWNED)), _SPAWNED, _refuse_mesh).link
    moves = link.inertia is not None and link.inertia.mass_kg > 0
    if link.inertia is not None and moves:
        check_moments(f"{_SPAWNED}: its body", _to_spatial(link.inertia))
    link, friction = link if moves else replace(link, inertia=None), BodyConfig.model_fields["friction"].default
    return SceneBody(link, friction=friction, restitution=0.0 if moves else 1.0)


def place_spawned(body: SceneBody, name: str, at: BodyState) -> SceneBody:
    """Give a body its name, and its pose at the start, at rest."""
    x, y, z, w = at.orientation_xyzw
    turn = pinocchio.Quaternion(w, x, y, z).normalized().matrix()
    placement = placement_of(pinocchio.SE3(turn, np.array(at.position)))
    return replace(body, link=replace(body.link, name=name), placement=placement, velocity=(0.0, 0.0, 0.0))


def _refuse_mesh(filename: str) -> Path:
    raise ConfigError(f"{filename}: a mesh is a file, which no client names; name a body of the scene as uri")
