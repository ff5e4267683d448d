"""The model of a robot's joints, without a tool and a posture, and poses in it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from throwcollect.engines.as_described import build_model
from throwcollect.engines.body import HERE, INERTIA, BodyJoint, LinkInertia, Placement
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError
from throwcollect.robots.robot import Robot
from throwcollect.robots.tools.tool import Tool

_ROUNDING = 1e-6
"""Share by which the largest moment of inertia may exceed the sum of the others, as numbers in files are rounded."""


@lru_cache(maxsize=4)
def joint_model(robot: Robot) -> pinocchio.Model:
    """Build a model of all joints of a robot, without a tool; callers must not change it.

    It is cached, because each trial with other locked joints or another tool needs it.
    """
    try:
        model = build_model(robot.description.model)
    except (ValueError, RuntimeError) as error:
        raise ConfigError(f"{robot.urdf_path}: cannot be read as robot description: {error}") from error
    # Engines would change a body that cannot be, or drop it. Pinocchio's first joint is the universe.
    for joint, body in zip(model.names[1:], model.inertias[1:], strict=True):
        where = f"{robot.urdf_path}: link {robot.description.joints[joint].child}, which {joint} moves,"
        if body.mass <= 0:
            raise ConfigError(f"{where} has no mass", hint="give it an <inertial> with <mass> and <inertia> in a copy")
        check_moments(where, body)
    return model


def check_moments(where: str, body: pinocchio.Inertia) -> None:
    """Make sure that a body can have these moments of inertia."""
    least, middle, most = np.linalg.eigvalsh(body.inertia)
    if least <= 0 or least + middle < most * (1 - _ROUNDING):
        raise ConfigError(
            f"{where} has principal moments of inertia of {least:.4g}, {middle:.4g} and {most:.4g} kg m², "
            "which no body can have: they are above 0, and none is larger than the sum of the others",
            hint="correct its <inertia> in a copy of the URDF",
        )


def lock_joints(model: pinocchio.Model, locked: Mapping[str, float]) -> pinocchio.Model:
    """Make a model in which some joints are fixed at angles [rad]; the given model stays as it is."""
    configuration = pinocchio.neutral(model)
    numbers = [model.getJointId(joint) for joint in locked]
    for number, angle in zip(numbers, locked.values(), strict=True):
        configuration[model.idx_qs[number]] = angle
    return pinocchio.buildReducedModel(model, numbers, configuration)


def mount_of(robot: Robot, tool: Tool) -> pinocchio.SE3:
    """Find the pose of a tool's frame in the link that it is fixed to."""
    return tool.mount if robot.tool_pose == HERE else pose_of(robot.tool_pose) * tool.mount


def move_joint(joint: BodyJoint, position: float) -> Placement:
    """Find the pose of a joint's child in its parent at a position [rad; m for a prismatic joint]."""
    if position == 0:
        return joint.placement
    axis = np.array(joint.axis)
    if joint.kind == "prismatic":
        moved = pinocchio.SE3(np.eye(3), axis * position)
    else:
        moved = pinocchio.SE3(pinocchio.AngleAxis(position, axis).toRotationMatrix(), np.zeros(3))
    return placement_of(pose_of(joint.placement) * moved)


def pose_of(placement: Placement) -> pinocchio.SE3:
    """Convert a placement of a URDF."""
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*placement.rpy), np.array(placement.xyz))


def placement_of(pose: pinocchio.SE3) -> Placement:
    """Convert a pose into a placement of a URDF."""
    return Placement(tuple(pose.translation.tolist()), tuple(pinocchio.rpy.matrixToRpy(pose.rotation).tolist()))


def describe_inertia(body: pinocchio.Inertia) -> LinkInertia:
    """Convert an inertia, whose axes stay those of its frame."""
    moments = tuple(float(body.inertia[place]) for place in INERTIA.values())
    return LinkInertia(float(body.mass), placement_of(pinocchio.SE3(np.eye(3), body.lever)), moments)
