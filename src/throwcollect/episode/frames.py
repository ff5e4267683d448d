"""Coordinate frames of a robot, from its URDF: those that never move, and those that joints move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import BodyJoint, turn_of
from throwcollect.engines.pose import multiply
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import cos, sin
from throwcollect.robots.urdf import parse_xml, read_urdf

WORLD = "world"
"""Name of the fixed frame: x forward, y left, z up, on the ground."""


@dataclass(frozen=True)
class Frame:
    """A frame and its pose in its parent when its joint is at 0.

    Attributes:
        parent: Name of the parent.
        child: Name of the frame itself.
        translation: Origin of the frame in its parent [m].
        rotation_xyzw: Unit quaternion, frame to parent.
        joint: Name of the joint that moves the frame; empty if it never moves.
        axis: Unit vector in the frame, about which the joint turns it.
        slides: Whether the joint moves the frame along the axis instead.
    """

    parent: str
    child: str
    translation: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]
    joint: str = ""
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    slides: bool = False

    def translation_at(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the origin in the parent [m], ``(n, 3)``, at positions of a sliding joint [m] of shape ``(n,)``."""
        x, y, z = self._turn_axis()
        return np.stack([a + each * distance for a, each in zip(self.translation, (x, y, z), strict=True)], axis=-1)

    def _turn_axis(self) -> tuple[float, float, float]:
        """Turn the axis into the parent's frame."""
        qx, qy, qz, qw = self.rotation_xyzw
        x, y, z = self.axis
        # Twice the cross product of the quaternion's vector with the axis.
        tx, ty, tz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
        return (
            x + qw * tx + qy * tz - qz * ty,
            y + qw * ty + qz * tx - qx * tz,
            z + qw * tz + qx * ty - qy * tx,
        )

    def rotation_at(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute unit quaternions (x, y, z, w), frame to parent, ``(n, 4)``, at angles [rad] of shape ``(n,)``."""
        half = angle / 2
        sine, w2 = sin(half), cos(half)
        # The turn about the joint's axis comes first, and then that of the frame at angle 0.
        x, y, z = (component * sine for component in self.axis)
        return np.stack(multiply(self.rotation_xyzw, (x, y, z, w2)), axis=-1)


@dataclass(frozen=True)
class FrameTree:
    """All frames of a robot that stands in the world.

    Attributes:
        fixed: Frames that never move; the first is the robot's root in `WORLD`.
        moving: Frames that joints move.
        links: Names of all links: the root first, and the others in the order of the description.
    """

    fixed: tuple[Frame, ...]
    moving: tuple[Frame, ...]
    links: tuple[str, ...]


@lru_cache(maxsize=4)
def read_frames(urdf: str, *, base_height: float) -> FrameTree:
    """Read the frames of a robot whose root link is at a height above the ground [m].

    They are cached, as several parts of a process need the frames of its only robot.
    """
    model = read_urdf(parse_xml(urdf, "robot description"), "robot description").model
    frames = [_frame_of(joint) for joint in model.joints]
    root = Frame(WORLD, model.links[0].name, (0.0, 0.0, base_height), (0.0, 0.0, 0.0, 1.0))
    return FrameTree(
        fixed=(root, *(frame for frame in frames if not frame.joint)),
        moving=tuple(frame for frame in frames if frame.joint),
        links=tuple(link.name for link in model.links),
    )


def _frame_of(joint: BodyJoint) -> Frame:
    if joint.kind not in ("fixed", "revolute", "continuous", "prismatic"):
        raise ConfigError(
            f"robot description: joint {joint.name} is {joint.kind}",
            expected="fixed, revolute, continuous or prismatic",
        )
    translation, rotation = joint.placement.xyz, turn_of(joint.placement)
    if not joint.moves:
        return Frame(joint.parent, joint.child, translation, rotation)
    x, y, z = joint.axis
    length = math.hypot(x, y, z)
    axis = x / length, y / length, z / length
    return Frame(joint.parent, joint.child, translation, rotation, joint.name, axis, joint.kind == "prismatic")
