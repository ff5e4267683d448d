"""Talos' description in URDF, with the spoon: in full for onlookers, and reduced to what the physics has to move."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio

from throwcollect.config.schema import Config, ToolConfig
from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.model import half_sitting, joint_limits, share_directory, urdf_path
from throwcollect.robots.spoon import boxes, inertia
from throwcollect.robots.talos import JOINTS

SPOON = "spoon_link"
"""Link of the spoon."""

_GRIPPER = "gripper_right_base_link"
_PACKAGE = "package://"


@dataclass(frozen=True)
class Description:
    """The robot as the physics loads it.

    Attributes:
        urdf: URDF text; mesh paths are absolute, every movable joint of it is in `moving`.
        moving: Joints that are simulated, in the order of `talos.JOINTS`.
        locked: Angle [rad] at which each other joint is fixed.
    """

    urdf: str
    moving: tuple[str, ...]
    locked: Mapping[str, float]


def start_posture(config: Config) -> Mapping[str, float]:
    """Angle [rad] of each of the 32 joints at the start of a trial, in the order of `talos.JOINTS`.

    A joint's angle is that of ``task.start``, else of ``robot.posture``, else of the half-sitting posture.

    Args:
        config: The configuration of the trial.

    Raises:
        ConfigError: If Talos' files cannot be read.
    """
    return MappingProxyType({**half_sitting(), **config.robot.posture, **config.task.start})


def locked_joints(config: Config) -> Mapping[str, float]:
    """Joints that are simulated as rigid and their angles [rad], in the order of `talos.JOINTS`.

    Args:
        config: The configuration; of ``robot.locked``, ``auto`` locks what the task does not move.

    Raises:
        ConfigError: If a joint that is to be locked is unknown or moved by the task, or Talos' files cannot be read.
    """
    posture = start_posture(config)
    moved = config.task.end
    choice = config.robot.locked
    if choice == "none":
        names: set[str] = set()
    elif choice == "auto":
        names = set(JOINTS) - set(moved)
    else:
        names = set(choice)
    problems = [Problem(f"Talos has no joint {joint}", "robot.locked") for joint in sorted(names - set(JOINTS))]
    problems += [
        Problem(f"{joint} cannot be locked, as task.end moves it", "robot.locked")
        for joint in sorted(names & set(moved))
    ]
    if problems:
        raise ConfigError(problems)
    return MappingProxyType({joint: posture[joint] for joint in JOINTS if joint in names})


def full_description(config: Config) -> str:
    """URDF text of Talos with the spoon: all 32 joints, visual and collision shapes, ``package://`` mesh paths.

    The right gripper has no collision shapes, as its fingers reach into the spoon's handle.

    Args:
        config: The configuration; only its section ``tool`` matters.

    Raises:
        ConfigError: If Talos' files cannot be read.
    """
    robot = _talos()
    robot.append(_spoon_link(config.tool, visual=True))
    robot.append(_spoon_joint(_GRIPPER, _mount(config.tool)))
    return _text(robot)


def touchable_bodies() -> frozenset[str]:
    """Names under which contacts of the ball are recorded: ``spoon``, ``ground``, and the links of Talos.

    Raises:
        ConfigError: If Talos' files cannot be read.
    """
    return frozenset({"spoon", "ground", *(link.get("name", "") for link in _talos().iter("link"))})


def joint_model() -> pinocchio.Model:
    """Talos without the spoon as a model of its 32 joints.

    Raises:
        ConfigError: If Talos' files cannot be read, or lack something.
    """
    # What they lack is looked for before the URDF's parser prints it in its own words.
    joint_limits()
    half_sitting()
    return _whole(_talos())


def physics_description(config: Config) -> Description:
    """URDF of Talos with the spoon in which every fixed or locked joint is merged away, except the spoon's own.

    A link carries the name of the link that its joint moves in Talos' URDF, and the mass, inertia and collision shapes
    of everything that is rigidly attached to it. There are no visual shapes.

    Args:
        config: The configuration; of it ``robot``, ``tool`` and ``task`` matter.

    Returns:
        The same text, byte for byte, for the same configuration.

    Raises:
        ConfigError: If the choice of locked joints is wrong, or Talos' files cannot be read.
    """
    locked = locked_joints(config)
    source = _talos()
    model = _reduced(source, locked)
    joints = {joint.get("name"): joint for joint in source.iter("joint")}
    names = [_root_link(source), *(_child(joints[name]) for name in model.names[1:])]

    robot = ElementTree.Element("robot", name=source.get("name", "talos"))
    for number, name in enumerate(names):
        robot.append(_link(name, model.inertias[number], _shapes(source, model, number)))
    for number in range(1, model.njoints):
        joint = ElementTree.SubElement(robot, "joint", name=model.names[number], type="revolute")
        ElementTree.SubElement(joint, "parent", link=names[model.parents[number]])
        ElementTree.SubElement(joint, "child", link=names[number])
        joint.append(_origin(model.jointPlacements[number]))
        for tag in ("axis", "limit", "dynamics"):
            joint.extend(joints[model.names[number]].findall(tag))
    gripper = model.frames[model.getFrameId(_GRIPPER, pinocchio.BODY)]
    robot.append(_spoon_link(config.tool, visual=False))
    robot.append(_spoon_joint(names[gripper.parentJoint], gripper.placement * _mount(config.tool)))
    moving = tuple(joint for joint in JOINTS if joint not in locked)
    return Description(urdf=_text(robot), moving=moving, locked=locked)


def _talos() -> ElementTree.Element:
    """Links and joints of Talos' URDF, without the collision shapes of the right gripper."""
    path = urdf_path()
    try:
        source = ElementTree.parse(path).getroot()  # noqa: S314 - a file of an installed package
    except (OSError, ElementTree.ParseError) as error:
        raise ConfigError(f"{path}: cannot be read as robot description: {error}") from error
    robot = ElementTree.Element("robot", name=source.get("name", "talos"))
    for kind in ("material", "link", "joint"):
        robot.extend(source.findall(kind))
    for link in robot.iter("link"):
        if link.get("name", "").startswith("gripper_right_"):
            for shape in link.findall("collision"):
                link.remove(shape)
    if robot.find(f"link[@name='{_GRIPPER}']") is None:
        raise ConfigError(f"{path}: link {_GRIPPER} is missing")
    return robot


def _whole(source: ElementTree.Element) -> pinocchio.Model:
    try:
        model = pinocchio.buildModelFromXML(ElementTree.tostring(source, encoding="unicode"))
    except (ValueError, RuntimeError) as error:
        raise ConfigError(f"{urdf_path()}: cannot be read as robot description: {error}") from error
    if missing := set(JOINTS) ^ set(model.names[1:]):
        raise ConfigError(f"{urdf_path()}: has other movable joints than Talos: {', '.join(sorted(missing))}")
    return model


def _reduced(source: ElementTree.Element, locked: Mapping[str, float]) -> pinocchio.Model:
    model = _whole(source)
    configuration = pinocchio.neutral(model)
    numbers = [model.getJointId(joint) for joint in locked]
    for number, angle in zip(numbers, locked.values(), strict=True):
        configuration[model.idx_qs[number]] = angle
    return pinocchio.buildReducedModel(model, numbers, configuration)


def _shapes(source: ElementTree.Element, model: pinocchio.Model, joint: int) -> list[ElementTree.Element]:
    """Collision shapes of all links that move with a joint, placed in its frame."""
    shapes = []
    for link in source.iter("link"):
        frame = model.frames[model.getFrameId(link.get("name"), pinocchio.BODY)]
        if frame.parentJoint != joint:
            continue
        for original in link.findall("collision"):
            shape = ElementTree.Element("collision")
            shape.append(_origin(frame.placement * _read_origin(original)))
            geometry = ElementTree.SubElement(shape, "geometry")
            geometry.extend(copy.deepcopy(list(original.iterfind("geometry/*"))))
            for mesh in geometry.iter("mesh"):
                relative = mesh.get("filename", "").removeprefix(_PACKAGE)
                mesh.set("filename", str(share_directory() / relative))
            shapes.append(shape)
    return shapes


def _link(name: str, body: pinocchio.Inertia, shapes: list[ElementTree.Element]) -> ElementTree.Element:
    link = ElementTree.Element("link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    inertial.append(_origin(pinocchio.SE3(np.eye(3), body.lever)))
    ElementTree.SubElement(inertial, "mass", value=_number(body.mass))
    keys = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(inertial, "inertia", {key: _number(body.inertia[place]) for key, place in keys.items()})
    link.extend(shapes)
    return link


def _spoon_link(tool: ToolConfig, *, visual: bool) -> ElementTree.Element:
    shapes = []
    for kind in ("visual", "collision") if visual else ("collision",):
        for box in boxes(tool):
            shape = ElementTree.Element(kind)
            shape.append(_origin(box.placement))
            geometry = ElementTree.SubElement(shape, "geometry")
            ElementTree.SubElement(geometry, "box", size=" ".join(map(_number, box.size)))
            shapes.append(shape)
    return _link(SPOON, inertia(tool), shapes)


def _spoon_joint(parent: str, placement: pinocchio.SE3) -> ElementTree.Element:
    joint = ElementTree.Element("joint", name="spoon_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=SPOON)
    joint.append(_origin(placement))
    return joint


def _mount(tool: ToolConfig) -> pinocchio.SE3:
    return pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -tool.mount_offset_m]))


def _child(joint: ElementTree.Element) -> str:
    child = joint.find("child")
    return child.get("link", "") if child is not None else ""


def _root_link(source: ElementTree.Element) -> str:
    children = {_child(joint) for joint in source.iter("joint")}
    return next(name for link in source.iter("link") if (name := link.get("name", "")) not in children)


def _read_origin(element: ElementTree.Element) -> pinocchio.SE3:
    origin = element.find("origin")
    if origin is None:
        return pinocchio.SE3.Identity()
    xyz, rpy = ([float(number) for number in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*rpy), np.array(xyz))


def _origin(placement: pinocchio.SE3) -> ElementTree.Element:
    angles = pinocchio.rpy.matrixToRpy(placement.rotation)
    return ElementTree.Element(
        "origin", xyz=" ".join(map(_number, placement.translation)), rpy=" ".join(map(_number, angles))
    )


def _number(value: float) -> str:
    return repr(float(value))


def _text(robot: ElementTree.Element) -> str:
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"
