"""Forward kinematics of a tool, from the robot's description alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import BodyJoint
from throwcollect.engines.engine import Scene
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import cos, matmul, sin

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Joint:
    """One joint between base and tool.

    Attributes:
        turn: Orientation of its frame in the frame of the link before, shape ``(3, 3)``.
        place: Origin of its frame there [m], shape ``(3, 1)``.
        axis: Unit vector that it turns about, or slides along, in its frame.
        column: Column of the commands that it follows; None if it is fixed.
        slides: Whether it is prismatic.
    """

    turn: Array
    place: Array
    axis: Sequence[float]
    column: int | None
    slides: bool


class ToolPath:
    """The chain of joints from a robot's base to its tool.

    Raises:
        ConfigError: If a joint of the chain neither turns about an axis, nor slides along it, nor is fixed.
    """

    def __init__(self, scene: Scene) -> None:
        above = {joint.child: joint for joint in scene.robot.joints}
        chain = []
        link = scene.tool.link
        while (joint := above.get(link)) is not None:
            chain.append(_read_joint(joint, scene.moving))
            link = joint.parent
        self._chain = chain[::-1]
        self._base = np.array([[0.0], [0.0], [scene.base_height_m]])

    def along(self, positions: Array) -> tuple[Array, Array]:
        """Compute the frames of the tool's link in world.

        Args:
            positions: Positions of the moving joints [rad], shape ``(n, n_moving)``.

        Returns:
            Origins [m], shape ``(n, 3, 1)``, and orientations, shape ``(n, 3, 3)``.
        """
        place = np.broadcast_to(self._base, (len(positions), 3, 1))
        turn = np.broadcast_to(np.eye(3), (len(positions), 3, 3))
        for joint in self._chain:
            place = place + matmul(turn, joint.place)
            turn = matmul(turn, joint.turn)
            if joint.column is not None and joint.slides:
                way = positions[:, joint.column, np.newaxis, np.newaxis] * np.array(joint.axis).reshape(3, 1)
                place = place + matmul(turn, way)
            elif joint.column is not None:
                turn = matmul(turn, _make_rotations(joint.axis, positions[:, joint.column]))
        return place, turn


def _read_joint(joint: BodyJoint, moving: Sequence[str]) -> _Joint:
    if joint.kind not in ("fixed", "revolute", "continuous", "prismatic"):
        raise ConfigError(
            f"joint {joint.name}: the engine ballistic knows no {joint.kind} joints between base and tool"
        )
    place, angles = joint.placement
    turn = np.eye(3)
    # URDF's roll, pitch and yaw turn about the axes of the link before, roll first: the matrix of yaw times that of
    # pitch times that of roll.
    for axis, angle in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), angles[::-1], strict=True):
        turn = matmul(turn, _make_rotations(axis, np.array([angle]))[0])
    x, y, z = joint.axis
    length = math.hypot(x, y, z)
    column = moving.index(joint.name) if joint.moves else None
    direction = x / length, y / length, z / length
    return _Joint(turn, np.array(place).reshape(3, 1), direction, column, joint.kind == "prismatic")


def _make_rotations(axis: Sequence[float], angles: Array) -> Array:
    """Make rotations about a unit vector, by Rodrigues' formula, shape ``(n, 3, 3)``."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sines, cosines = (values[:, np.newaxis, np.newaxis] for values in (sin(angles), cos(angles)))
    rotations: Array = np.eye(3) + sines * across + (1.0 - cosines) * matmul(across, across)
    return rotations
