"""Forward kinematics of a tool, from the robot's description alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import BodyJoint
from throwcollect.engines.engine import Scene
from throwcollect.reproducible_math import cos, matmul, sin

Array = NDArray[np.float64]


class ToolPath:
    """The chain of joints from a robot's base to its tool, which are fixed, turn about an axis, or slide along it."""

    def __init__(self, scene: Scene) -> None:
        above = {joint.child: joint for joint in scene.robot.joints}
        self._chain: list[tuple[BodyJoint, Array, list[float]]] = []
        joint = above.get(scene.tool.link)
        while joint is not None:
            turn, length = np.eye(3), math.hypot(*joint.axis)
            # URDF's roll, pitch and yaw turn about the axes of the link before, roll first: the matrix of yaw times
            # that of pitch times that of roll.
            for axis, angle in zip(((0, 0, 1), (0, 1, 0), (1, 0, 0)), joint.placement.rpy[::-1], strict=True):
                turn = matmul(turn, _make_rotations(axis, np.array([angle]))[0])
            self._chain.insert(0, (joint, turn, [each / length for each in joint.axis]))
            joint = above.get(joint.parent)
        self._columns = {name: column for column, name in enumerate(scene.moving)}
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
        for joint, turned, axis in self._chain:
            place = place + matmul(turn, np.array(joint.placement.xyz).reshape(3, 1))
            turn = matmul(turn, turned)
            if joint.kind == "prismatic":
                way = positions[:, self._columns[joint.name], np.newaxis, np.newaxis] * np.array(axis).reshape(3, 1)
                place = place + matmul(turn, way)
            elif joint.moves:
                turn = matmul(turn, _make_rotations(axis, positions[:, self._columns[joint.name]]))
        return place, turn


def _make_rotations(axis: Sequence[float], angles: Array) -> Array:
    """Make rotations about a unit vector, by Rodrigues' formula, shape ``(n, 3, 3)``."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sines, cosines = (values[:, np.newaxis, np.newaxis] for values in (sin(angles), cos(angles)))
    rotations: Array = np.eye(3) + sines * across + (1.0 - cosines) * matmul(across, across)
    return rotations
