"""Writes a robot's description with its tool in URDF: in full for viewers, reduced to moving parts for the physics."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, MemberError
from throwcollect.extras import MissingExtraError, is_installed
from throwcollect.members import load_member
from throwcollect.pinocchio_library import pinocchio
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot, read_xml
from throwcollect.tools.tool import Tool, tool_of

PACKAGE = "package://"
"""Beginning of the URLs of meshes in a description, which the name of a package follows."""
_NUMBERS: Mapping[str, Mapping[str, int]] = MappingProxyType(
    {
        "origin": {"xyz": 3, "rpy": 3},
        "axis": {"xyz": 3},
        "mass": {"value": 1},
        "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
        "box": {"size": 3},
        "mesh": {"scale": 3},
        "sphere": {"radius": 1},
        "cylinder": {"radius": 1, "length": 1},
    }
)
"""Attributes of elements of a URDF, with how many numbers each has; `joint_limits` reads those of `<limit>`."""
_written: dict[tuple[Robot, str], str] = {}
"""The latest full descriptions, by robot and configuration of the tool. They are kept, because everything that looks at
a dataset needs the same description, and writing it takes 20 ms."""
_MOST_WRITTEN = 8


@dataclass(frozen=True)
class Description:
    """The robot as the physics loads it.

    Attributes:
        urdf: URDF text; mesh paths are absolute, and every movable joint in the text is in `moving`.
        moving: Joints that are simulated, in the order of `Robot.joints`.
        locked: Angle [rad] at which each of the other joints is fixed.
    """

    urdf: str
    moving: tuple[str, ...]
    locked: Mapping[str, float]


def robot_of(config: Config) -> Robot:
    """Look up the robot that a configuration names."""
    robot: Robot = load_member("robots", config.robot.name)
    return robot


def is_available(config: Config) -> bool:
    """Say whether the robot's files, and the library that computes with them, are installed."""
    try:
        _ = robot_of(config).directory
    except (ConfigError, MemberError, MissingExtraError):
        return False
    return is_installed("pinocchio")


def start_posture(config: Config) -> Mapping[str, float]:
    """Find the angle [rad] of each joint at the start of a trial, in the order of `Robot.joints`.

    The angle of a joint is taken from ``task.start``, or else ``robot.posture``, or else the robot's posture at rest.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    return MappingProxyType({**robot_of(config).rest_posture, **config.robot.posture, **config.task.start})


def joint_offsets(config: Config) -> NDArray[np.float64]:
    """List the true angle minus the measured one of each joint [rad], shape ``(n_joints,)``, as `Robot.joints`."""
    offsets = config.robot.joint_offsets
    return np.array([offsets.get(joint, 0.0) for joint in robot_of(config).joints])


def find_locked_joints(config: Config) -> Mapping[str, float]:
    """Find the joints that are simulated as rigid and their angles [rad], in the order of `Robot.joints`.

    For ``robot.locked: auto``, these are all joints that the task does not move.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    choice = config.robot.locked
    posture = start_posture(config)
    if choice == "auto":
        return MappingProxyType({joint: angle for joint, angle in posture.items() if joint not in config.task.end})
    return MappingProxyType({joint: angle for joint, angle in posture.items() if choice != "none" and joint in choice})


def full_description(config: Config) -> str:
    """Write the URDF text of the robot with its tool: all joints, visual and collision shapes, ``package://`` paths.

    The hand has no collision shapes, because its fingers reach into the tool's handle.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    robot = robot_of(config)
    key = robot, config.tool.model_dump_json()
    # Another thread may clear the dictionary at any moment.
    if (text := _written.get(key)) is None:
        if len(_written) >= _MOST_WRITTEN:
            _written.clear()
        text = _written[key] = _write_full(robot, tool_of(config))
    return text


def _write_full(robot: Robot, tool: Tool) -> str:
    description = _read_description(robot)
    description.append(_make_tool_link(tool, visual=True))
    description.append(_make_tool_joint(tool, robot.hand, tool.mount))
    return _write_text(description)


def touchable_bodies(config: Config) -> frozenset[str]:
    """List the names under which contacts of the ball are recorded: the tool, ``ground``, and the robot's links.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    return frozenset({tool_of(config).name, "ground", *_list_links(robot_of(config))})


@lru_cache(maxsize=4)
def _list_links(robot: Robot) -> tuple[str, ...]:
    return tuple(link.get("name", "") for link in _read_description(robot).iter("link"))


@lru_cache(maxsize=4)
def joint_model(robot: Robot) -> pinocchio.Model:
    """Build a model of all joints of a robot, without a tool; callers must not change it.

    Raises:
        ConfigError: If the robot's files cannot be read, or lack something.
    """
    # These raise our own errors if the files lack something; Pinocchio's parser would print its errors to the terminal.
    joint_limits(robot)
    _ = robot.rest_posture
    return _read_whole(robot)[1]


def physics_description(config: Config) -> Description:
    """Write a URDF of the robot with its tool, without fixed or locked joints, except the one that holds the tool.

    Links that such a joint connects become one link. It has the name of the link that the moving joint before it moves
    in the robot's URDF, and mass, inertia and collision shapes of all of these links. There are no visual shapes. Equal
    configurations give equal bytes.

    Raises:
        ConfigError: If the robot's files cannot be read.
    """
    robot, tool = robot_of(config), tool_of(config)
    check_name_of_tool(robot, tool)
    locked = find_locked_joints(config)
    source, whole = _read_whole(robot)
    model = lock_joints(whole, locked)
    joints = {joint.get("name"): joint for joint in source.iter("joint")}
    names = [_find_root_link(source), *(_find_child(joints[name]) for name in model.names[1:])]

    description = ElementTree.Element("robot", name=source.get("name", robot.name))
    for number, name in enumerate(names):
        description.append(_make_link(name, model.inertias[number], _collect_shapes(robot, source, model, number)))
    for number in range(1, model.njoints):
        joint = ElementTree.SubElement(description, "joint", name=model.names[number], type="revolute")
        ElementTree.SubElement(joint, "parent", link=names[model.parents[number]])
        ElementTree.SubElement(joint, "child", link=names[number])
        joint.append(_make_origin(model.jointPlacements[number]))
        for tag in ("axis", "limit", "dynamics"):
            # The elements are copied, because writing the text indents each element, perhaps in another thread.
            joint.extend(copy.deepcopy(joints[model.names[number]].findall(tag)))
    hand = model.frames[model.getFrameId(robot.hand, pinocchio.BODY)]
    description.append(_make_tool_link(tool, visual=False))
    description.append(_make_tool_joint(tool, names[hand.parentJoint], hand.placement * tool.mount))
    moving = tuple(joint for joint in robot.joints if joint not in locked)
    return Description(urdf=_write_text(description), moving=moving, locked=locked)


def check_name_of_tool(robot: Robot, tool: Tool) -> None:
    """Make sure that a contact with the tool is not taken for one with the ground or a part of the robot.

    Raises:
        ConfigError: If one of these has the name of the tool or of its link.
    """
    if taken := {tool.name, tool.link} & {"ground", *_list_links(robot)}:
        raise ConfigError(
            f"tool.name: the tool is recorded as {tool.name}, with the link {tool.link}; the ground or a link of "
            f"{robot.title} has the name {', '.join(sorted(taken))}, too",
            hint="give the tool another name, and the same one to its entry point",
        )


def _check_numbers(path: Path, description: ElementTree.Element) -> None:
    """Make sure that numbers of links and joints can be read, because Pinocchio takes 0 for a mass that cannot.

    Raises:
        ConfigError: If a number cannot be read or is not finite, or a mass is below 0.
    """
    for element in (each for kind in ("link", "joint") for part in description.iter(kind) for each in part.iter()):
        for key, count in _NUMBERS.get(element.tag, {}).items():
            if (text := element.get(key)) is None:
                continue
            try:
                numbers = [float(each) for each in text.split()]
            except ValueError:
                numbers = []
            if len(numbers) != count or not np.isfinite(numbers).all() or (element.tag == "mass" and numbers[0] < 0):
                numeral = "a finite number" if count == 1 else f"{count} finite numbers"
                wanted = "a mass of at least 0" if element.tag == "mass" else numeral
                raise ConfigError(f"{path}: {key} of <{element.tag}> should be {wanted}, is {text!r}")


def _read_description(robot: Robot) -> ElementTree.Element:
    """Read the links and joints of the robot's URDF, without the collision shapes of the hand that holds the tool.

    Raises:
        ConfigError: If it or a number in it cannot be read, or it has no link of the hand's name.
    """
    path = robot.urdf_path
    source = read_xml(path)
    description = ElementTree.Element("robot", name=source.get("name", robot.name))
    for kind in ("material", "link", "joint"):
        description.extend(source.findall(kind))
    for link in description.iter("link"):
        if robot.open_hand and link.get("name", "").startswith(robot.open_hand):
            for shape in link.findall("collision"):
                link.remove(shape)
    if description.find(f"link[@name='{robot.hand}']") is None:
        raise ConfigError(f"{path}: link {robot.hand} is missing")
    _check_numbers(path, description)
    links, joints = ({element.get("name", "") for element in description.findall(kind)} for kind in ("link", "joint"))
    if shared := links & joints:
        # Pinocchio has a frame for the joint and one for the link, and cannot tell which one is meant.
        raise ConfigError(
            f"{path}: a joint has the name of a link: {', '.join(sorted(shared))}", hint="rename the joint in a copy"
        )
    return description


@lru_cache(maxsize=4)
def _read_whole(robot: Robot) -> tuple[ElementTree.Element, pinocchio.Model]:
    """Read a robot's URDF, and build a model of all of its joints; callers must not change either.

    Both are cached, because each trial with other locked joints or another tool needs them, and reading takes 7 ms.

    Raises:
        ConfigError: If the robot's files cannot be read, or lack something.
    """
    source = _read_description(robot)
    return source, _build_model(robot, source)


def _build_model(robot: Robot, source: ElementTree.Element) -> pinocchio.Model:
    try:
        model = pinocchio.buildModelFromXML(ElementTree.tostring(source, encoding="unicode"))
    except (ValueError, RuntimeError) as error:
        raise ConfigError(f"{robot.urdf_path}: cannot be read as robot description: {error}") from error
    # Pinocchio's first joint is the universe.
    if missing := set(robot.joints) ^ set(model.names[1:]):
        raise ConfigError(
            f"{robot.urdf_path}: has other movable joints than {robot.title}: {', '.join(sorted(missing))}"
        )
    types = {joint.get("name"): joint.get("type") for joint in source.iter("joint")}
    if others := [f"{joint} is {types[joint]}" for joint in robot.joints if types[joint] != "revolute"]:
        raise ConfigError(f"{robot.urdf_path}: joints should be revolute or fixed; {', '.join(others)}")
    return model


def lock_joints(model: pinocchio.Model, locked: Mapping[str, float]) -> pinocchio.Model:
    """Make a model in which some joints are fixed at angles [rad]; the given model stays as it is."""
    configuration = pinocchio.neutral(model)
    numbers = [model.getJointId(joint) for joint in locked]
    for number, angle in zip(numbers, locked.values(), strict=True):
        configuration[model.idx_qs[number]] = angle
    return pinocchio.buildReducedModel(model, numbers, configuration)


def _collect_shapes(
    robot: Robot, source: ElementTree.Element, model: pinocchio.Model, joint: int
) -> list[ElementTree.Element]:
    """Collect the collision shapes of all links that move with a joint, placed in the frame of the joint."""
    shapes = []
    for link in source.iter("link"):
        frame = model.frames[model.getFrameId(link.get("name"), pinocchio.BODY)]
        if frame.parentJoint != joint:
            continue
        for original in link.findall("collision"):
            shape = ElementTree.Element("collision")
            shape.append(_make_origin(frame.placement * _read_origin(original)))
            geometry = ElementTree.SubElement(shape, "geometry")
            geometry.extend(copy.deepcopy(list(original.iterfind("geometry/*"))))
            for mesh in geometry.iter("mesh"):
                relative = mesh.get("filename", "").removeprefix(PACKAGE)
                mesh.set("filename", str(robot.directory / relative))
            shapes.append(shape)
    return shapes


def _make_link(name: str, body: pinocchio.Inertia, shapes: list[ElementTree.Element]) -> ElementTree.Element:
    link = ElementTree.Element("link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    inertial.append(_make_origin(pinocchio.SE3(np.eye(3), body.lever)))
    ElementTree.SubElement(inertial, "mass", value=_format_number(body.mass))
    keys = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(
        inertial, "inertia", {key: _format_number(body.inertia[place]) for key, place in keys.items()}
    )
    link.extend(shapes)
    return link


def _make_tool_link(tool: Tool, *, visual: bool) -> ElementTree.Element:
    shapes = []
    for kind in ("visual", "collision") if visual else ("collision",):
        for box in tool.boxes:
            shape = ElementTree.Element(kind)
            shape.append(_make_origin(box.placement))
            geometry = ElementTree.SubElement(shape, "geometry")
            ElementTree.SubElement(geometry, "box", size=" ".join(map(_format_number, box.size)))
            shapes.append(shape)
    return _make_link(tool.link, tool.inertia, shapes)


def _make_tool_joint(tool: Tool, parent: str, placement: pinocchio.SE3) -> ElementTree.Element:
    joint = ElementTree.Element("joint", name=f"{tool.name}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=tool.link)
    joint.append(_make_origin(placement))
    return joint


def _find_child(joint: ElementTree.Element) -> str:
    child = joint.find("child")
    return child.get("link", "") if child is not None else ""


def _find_root_link(source: ElementTree.Element) -> str:
    children = {_find_child(joint) for joint in source.iter("joint")}
    return next(name for link in source.iter("link") if (name := link.get("name", "")) not in children)


def _read_origin(element: ElementTree.Element) -> pinocchio.SE3:
    origin = element.find("origin")
    if origin is None:
        return pinocchio.SE3.Identity()
    xyz, rpy = ([float(number) for number in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*rpy), np.array(xyz))


def _make_origin(placement: pinocchio.SE3) -> ElementTree.Element:
    angles = pinocchio.rpy.matrixToRpy(placement.rotation)
    return ElementTree.Element(
        "origin", xyz=" ".join(map(_format_number, placement.translation)), rpy=" ".join(map(_format_number, angles))
    )


def _format_number(value: float) -> str:
    return repr(float(value))


def _write_text(robot: ElementTree.Element) -> str:
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"
