"""Computes the torques that motions of a robot with its tool and a ball need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.pinocchio_library import pinocchio
from throwcollect.robots.description import lock_joints
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot
from throwcollect.tools.tool import Tool

Motion = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``, in the order of
`Robot.joints`."""


class Dynamics:
    """Inverse dynamics of a robot.

    Args:
        robot: The robot.
        model: Model of all its joints, without a tool.
        locked: Angle [rad] of each joint that is locked, which makes computing faster; empty if none is.
    """

    def __init__(self, robot: Robot, model: pinocchio.Model, locked: Mapping[str, float]) -> None:
        self._model = lock_joints(model, locked) if locked else model.copy()
        self._data = self._model.createData()
        # Columns of `Robot.joints` that are not locked, in the order of the model.
        self._columns = np.array([robot.joints.index(name) for name in list(self._model.names)[1:]], dtype=np.intp)
        hand = self._model.frames[self._model.getFrameId(robot.hand, pinocchio.BODY)]
        self._hand, self._hand_placement = hand.parentJoint, hand.placement.copy()
        self._bare_hand = self._model.inertias[self._hand].copy()
        self._damping = joint_limits(robot).damping[self._columns]

    def efforts(self, config: Config, tool: Tool, motion: Motion) -> NDArray[np.float64]:
        """Compute the torques that a motion of all joints needs, with tool and ball of a trial in the hand.

        In the motion, locked joints must rest at the angles at which they are locked.

        Returns:
            [Nm], shape ``(n, n_joints)``, in the order of `Robot.joints`; 0 for locked joints.
        """
        seat = np.array(tool.ball_seat(config.ball.radius_m))
        ball = pinocchio.Inertia.FromSphere(config.ball.mass_kg, config.ball.radius_m)
        load = tool.inertia + pinocchio.SE3(np.eye(3), seat).act(ball)
        # The sum begins with the bare hand, because the model still holds the load of the previous trial.
        self._model.inertias[self._hand] = self._bare_hand + (self._hand_placement * tool.mount).act(load)
        self._model.gravity.linear = np.array([0.0, 0.0, -config.scene.gravity_mps2])
        positions, velocities, accelerations = (np.ascontiguousarray(array[:, self._columns]) for array in motion)
        rows = zip(positions, velocities, accelerations, strict=True)
        torques = np.array([pinocchio.rnea(self._model, self._data, *row) for row in rows])
        needed = np.zeros_like(motion[0])
        # Pinocchio's inverse dynamics leave out friction.
        needed[:, self._columns] = torques + self._damping * velocities
        return needed
