"""Computes the torques that a motion of a robot needs, with a tool and what lies in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.robots.joint_model import lock_joints, mount_of
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot
from throwcollect.robots.surroundings import object_of, starts_in_tool
from throwcollect.robots.tools.tool import Tool


class Dynamics:
    """Inverse dynamics of a robot.

    Attributes:
        columns: Places in `Robot.joints` of the joints that are not locked, in the order of the model.

    Args:
        robot: The robot.
        model: Model of all its joints, without a tool.
        locked: Angle [rad] of each joint that is locked, which makes computing faster; empty if none is.
    """

    def __init__(self, robot: Robot, model: pinocchio.Model, locked: Mapping[str, float]) -> None:
        self._model = lock_joints(model, locked) if locked else model.copy()
        self.columns = np.array([robot.joints.index(name) for name in list(self._model.names)[1:]], dtype=np.intp)
        hand = self._model.frames[self._model.getFrameId(robot.hand, pinocchio.BODY)]
        self._robot = robot
        self._hand, self._hand_placement = hand.parentJoint, hand.placement.copy()
        self._bare_hand = self._model.inertias[self._hand].copy()
        self._damping = joint_limits(robot).damping[self.columns]

    def efforts(self, config: Config, tool: Tool, motion: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compute the torques that a motion of the joints of `columns` needs, with tool and ball in the hand.

        Returns:
            [Nm], shape ``(n, n_joints)``, of the same joints.
        """
        load = tool.inertia
        if starts_in_tool(config):
            thing = object_of(config)
            seat, inertia = np.array(tool.ball_seat(thing.radius_m)), thing.inertia
            held = pinocchio.Inertia(inertia.mass_kg, np.zeros(3), np.diag(inertia.diagonal))
            load += pinocchio.SE3(np.eye(3), seat).act(held)
        # The sum begins with the bare hand, because the model still holds the load of the previous trial.
        self._model.inertias[self._hand] = self._bare_hand + (self._hand_placement * mount_of(self._robot, tool)).act(
            load
        )
        self._model.gravity.linear = np.array([0.0, 0.0, -config.scene.gravity_mps2])
        torques = pinocchio.rneaInParallel(1, pinocchio.ModelPool(self._model, 1), *(array.T for array in motion))
        # Those of a single joint come as a vector. Pinocchio's inverse dynamics leave out friction.
        needed: NDArray[np.float64] = torques.reshape(motion[0].T.shape).T + self._damping * motion[1]
        return needed
