"""Coordinate frames of a robot, from its URDF: those that never move, and those that joints turn."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import cos, sin

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
    """

    parent: str
    child: str
    translation: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]


@dataclass(frozen=True)
class MovingFrame(Frame):
    """A frame that a revolute joint turns in its parent; the axis is a unit vector in the frame itself."""

    joint: str
    axis: tuple[float, float, float]

    def rotation_at(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute unit quaternions (x, y, z, w), frame to parent, ``(n, 4)``, at angles [rad] of shape ``(n,)``."""
        half = angle / 2
        sine, w2 = sin(half), cos(half)
        # This is the product of two quaternions: that of the frame at angle 0, and the turn about the joint's axis.
        x2, y2, z2 = (component * sine for component in self.axis)
        x1, y1, z1, w1 = self.rotation_xyzw
        return np.stack(
            [
                w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
                w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
                w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
                w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class FrameTree:
    """All frames of a robot that stands in the world.

    Attributes:
        fixed: Frames that never move; the first is the robot's root in `WORLD`.
        moving: Frames that joints turn.
    """

    fixed: tuple[Frame, ...]
    moving: tuple[MovingFrame, ...]


@lru_cache(maxsize=4)
def read_frames(urdf: str, *, base_height: float) -> FrameTree:
    """Read the frames of a robot whose root link is at a height above the ground [m].

    They are cached, as several parts of a process need the frames of its only robot.

    Raises:
        ConfigError: If the text is not a URDF, or a joint of it is neither fixed nor revolute.
    """
    try:
        robot = ElementTree.fromstring(urdf)  # noqa: S314 - the robot's own description
    except ElementTree.ParseError as error:
        raise ConfigError(f"robot description: not a URDF: {error}") from error
    frames = [_read_joint(joint) for joint in robot.findall("joint")]
    children = {frame.child for frame in frames}
    roots = [name for link in robot.findall("link") if (name := link.get("name", "")) not in children]
    if len(roots) != 1:
        raise ConfigError(f"robot description: {len(roots)} root links {roots}", expected="one")
    root = Frame(WORLD, roots[0], (0.0, 0.0, base_height), (0.0, 0.0, 0.0, 1.0))
    return FrameTree(
        fixed=(root, *(frame for frame in frames if not isinstance(frame, MovingFrame))),
        moving=tuple(frame for frame in frames if isinstance(frame, MovingFrame)),
    )


def _read_joint(joint: ElementTree.Element) -> Frame:
    name, kind = joint.get("name", ""), joint.get("type", "")
    if kind not in ("fixed", "revolute", "continuous"):
        raise ConfigError(f"robot description: joint {name} is {kind!r}", expected="fixed, revolute or continuous")
    try:
        parent, child = (joint.find(end).attrib["link"] for end in ("parent", "child"))  # type: ignore[union-attr]
        translation, rotation = read_origin(joint)
        if kind == "fixed":
            return Frame(parent, child, translation, rotation)
        # The default is that of the URDF specification.
        x, y, z = _read_vector(joint, "axis", "xyz", "1 0 0")
        length = math.hypot(x, y, z)
        return MovingFrame(parent, child, translation, rotation, name, (x / length, y / length, z / length))
    except (AttributeError, KeyError, ValueError, ZeroDivisionError) as error:
        raise ConfigError(f"robot description: joint {name} is not readable: {error}") from error


def read_origin(owner: ElementTree.Element) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Read the origin of a joint or a shape in URDF: translation [m], and unit quaternion (x, y, z, w).

    Raises:
        ValueError: If it is not made of numbers.
    """
    # The defaults are those of the URDF specification.
    roll, pitch, yaw = _read_vector(owner, "origin", "rpy", "0 0 0")
    return _read_vector(owner, "origin", "xyz", "0 0 0"), _make_quaternion(roll, pitch, yaw)


def _read_vector(owner: ElementTree.Element, tag: str, key: str, default: str) -> tuple[float, float, float]:
    element = owner.find(tag)
    x, y, z = map(float, (default if element is None else element.get(key, default)).split())
    return x, y, z


def _make_quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Make the unit quaternion (x, y, z, w) of rotations about the fixed axes x, y, z in this order, as in URDF."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(angle / 2), math.cos(angle / 2)) for angle in (roll, pitch, yaw))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
