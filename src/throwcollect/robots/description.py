"""Writes a robot's description with its tool in URDF: in full for viewers, reduced to moving parts for the physics."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.tool_config import ToolConfig
from throwcollect.engines.body import BodyJoint, BodyLink, BodyModel, LinkShape, to_text
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError, MemberError, Problem
from throwcollect.extras import MissingExtraError, is_installed
from throwcollect.robots.importing import find_robot
from throwcollect.robots.joint_model import describe_inertia, joint_model, lock_joints, mount_of, placement_of, pose_of
from throwcollect.robots.robot import Robot
from throwcollect.robots.tools.tool import Tool, make_tool, tool_of


@dataclass(frozen=True)
class Description:
    """The robot as the physics loads it.

    Attributes:
        model: Links and joints; every joint that moves is in `moving`.
        moving: Joints that are simulated, in the order of `Robot.joints`.
        locked: Angle [rad] at which each of the other joints is fixed.
    """

    model: BodyModel
    moving: tuple[str, ...]
    locked: Mapping[str, float]


def robot_of(config: Config) -> Robot:
    """Look up the robot that a configuration names."""
    return find_robot(config.robot)


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
    """
    return MappingProxyType({**robot_of(config).rest_posture, **config.robot.posture, **config.task.start})


def joint_offsets(config: Config) -> NDArray[np.float64]:
    """List the true angle minus the measured one of each joint [rad], shape ``(n_joints,)``, as `Robot.joints`."""
    offsets = config.robot.joint_offsets
    return np.array([offsets.get(joint, 0.0) for joint in robot_of(config).joints])


def find_locked_joints(config: Config) -> Mapping[str, float]:
    """Find the joints that are simulated as rigid and their angles [rad], in the order of `Robot.joints`.

    For ``robot.locked: auto``, these are all joints that the task does not move.
    """
    choice = config.robot.locked
    posture = start_posture(config)
    if choice == "auto":
        return MappingProxyType({joint: angle for joint, angle in posture.items() if joint not in config.task.end})
    return MappingProxyType({joint: angle for joint, angle in posture.items() if choice != "none" and joint in choice})


def full_description(config: Config) -> str:
    """Write the URDF text of the robot with its tool: all joints, visual and collision shapes, ``package://`` paths.

    The hand has no collision shapes, because its fingers reach into the tool's handle.
    """
    return _write_full(robot_of(config), config.tool.without_release())


# Everything that looks at a dataset needs the same description, and writing it takes 20 ms.
@lru_cache(maxsize=8)
def _write_full(robot: Robot, section: ToolConfig) -> str:
    _, tool = robot.description, make_tool(section)
    # The tree is copied, because writing the text indents each element, perhaps in another thread.
    description = copy.deepcopy(robot.xml)
    link, joint = _hold(tool, robot.hand, mount_of(robot, tool))
    held, *_ = made = list(BodyModel("", (link,), (joint,)).to_xml())
    visuals = copy.deepcopy(held.findall("collision"))
    for visual in visuals:
        visual.tag = "visual"
    # The inertia comes first.
    held[1:1] = visuals
    description.extend(made)
    return to_text(description)


def physics_description(config: Config) -> Description:
    """Describe the robot with its tool, without fixed or locked joints, except the one that holds the tool.

    Links that such a joint connects become one link. It has the name of the link that the moving joint before it moves
    in the robot's URDF, and mass, inertia and collision shapes of all of these links.
    """
    robot, tool = robot_of(config), tool_of(config)
    check_names(config, robot, tool)
    locked = find_locked_joints(config)
    source = robot.description
    model = lock_joints(joint_model(robot), locked)
    joints = [source.joints[name] for name in model.names[1:]]
    names = [source.model.links[0].name, *(joint.child for joint in joints)]
    links = [
        BodyLink(name, describe_inertia(model.inertias[number]), _collect_shapes(robot, model, number))
        for number, name in enumerate(names)
    ]
    merged = [
        replace(joint, parent=names[model.parents[number]], placement=placement_of(model.jointPlacements[number]))
        for number, joint in enumerate(joints, start=1)
    ]
    hand = model.frames[model.getFrameId(robot.hand, pinocchio.BODY)]
    held, mount = _hold(tool, names[hand.parentJoint], hand.placement * mount_of(robot, tool))
    whole = BodyModel(source.model.name or robot.name, links=(*links, held), joints=(*merged, mount))
    moving = tuple(joint for joint in robot.joints if joint not in locked)
    return Description(model=whole, moving=moving, locked=locked)


def check_names(config: Config, robot: Robot, tool: Tool) -> None:
    """Make sure that tool, ground, bodies of the scene and links of the robot have different names in contacts."""
    for name in {**config.scene.bodies, **config.task.bodies}:
        if name in (tool.link, *robot.description.links):
            sentence = f"should have another name, as a link of {robot.title} has this one"
            raise ConfigError([Problem(sentence, f"scene.bodies.{name}")])
    if taken := {tool.name, tool.link} & {"ground", *robot.description.links}:
        raise ConfigError(
            f"tool.name: the tool is recorded as {tool.name}, with the link {tool.link}; the ground or a link of "
            f"{robot.title} has the name {', '.join(sorted(taken))}, too",
            hint="give the tool another name, and the same one to its entry point",
        )


def _collect_shapes(robot: Robot, model: pinocchio.Model, joint: int) -> tuple[LinkShape, ...]:
    """Collect the collision shapes of all links that move with a joint, placed in the frame of the joint."""
    shapes = []
    for link in robot.description.model.links:
        frame = model.frames[model.getFrameId(link.name, pinocchio.BODY)]
        if frame.parentJoint == joint:
            shapes += [
                replace(shape, placement=placement_of(frame.placement * pose_of(shape.placement)))
                for shape in link.shapes
            ]
    return tuple(shapes)


def _hold(tool: Tool, hand: str, mount: pinocchio.SE3) -> tuple[BodyLink, BodyJoint]:
    """Describe a tool, and the joint that fixes it to a link."""
    boxes = tuple(LinkShape("box", box.size, placement_of(box.placement)) for box in tool.boxes)
    joint = BodyJoint(f"{tool.name}_joint", "fixed", hand, tool.link, placement_of(mount))
    return BodyLink(tool.link, describe_inertia(tool.inertia), boxes), joint
