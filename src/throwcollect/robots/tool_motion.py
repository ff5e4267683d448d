"""Computes position and velocity of the tool from the measured joints."""

from __future__ import annotations

import threading
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.robots.description import joint_offsets, robot_of
from throwcollect.robots.joint_model import joint_model, mount_of
from throwcollect.robots.robot import Robot
from throwcollect.robots.surroundings import object_of
from throwcollect.robots.tools.tool import tool_of


class ToolMotion:
    """Position and velocity of the seat in the world; the seat is the centre of a ball that rests in the tool.

    Raises:
        ConfigError: If the robot's files cannot be read, or the ball does not fit the tool.
    """

    def __init__(self, config: Config) -> None:
        tool = tool_of(config)
        self._seat = mount_of(robot_of(config), tool) * pinocchio.SE3(
            np.eye(3), np.array(tool.ball_seat(object_of(config).radius_m))
        )
        self._model = _model_of(robot_of(config), threading.get_ident())
        self._offsets = joint_offsets(config)
        self._base = np.array([0.0, 0.0, config.robot.base_height_m])

    def place(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the position of the seat [m], shape ``(3,)``, from positions of `Robot.joints` [rad]."""
        model = self._model
        pinocchio.forwardKinematics(model.model, model.data, (position + self._offsets)[model.order])
        hand = pinocchio.updateFramePlacement(model.model, model.data, model.hand)
        place: NDArray[np.float64] = self._base + (hand * self._seat).translation
        return place

    def velocity(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the velocity of the seat [m/s], ``(3,)``, from positions and velocities of `Robot.joints` [rad/s]."""
        model = self._model
        actual = position + self._offsets
        pinocchio.forwardKinematics(model.model, model.data, actual[model.order], velocity[model.order])
        hand = pinocchio.updateFramePlacement(model.model, model.data, model.hand)
        # The velocity of the seat, first along the axes of the seat, then along those of the world.
        along_seat = self._seat.actInv(pinocchio.getFrameVelocity(model.model, model.data, model.hand))
        turn = pinocchio.SE3((hand * self._seat).rotation, np.zeros(3))
        velocity_in_world: NDArray[np.float64] = turn.act(along_seat).linear
        return velocity_in_world


class _JointModel:
    """The kinematics of all joints of a robot; `order` gives the place of each model joint in `Robot.joints`."""

    def __init__(self, robot: Robot) -> None:
        self.model = joint_model(robot)
        self.data = self.model.createData()
        self.order = np.array([robot.joints.index(name) for name in list(self.model.names)[1:]], dtype=np.intp)
        self.hand = self.model.getFrameId(robot.hand, pinocchio.BODY)


@lru_cache(maxsize=64)
def _model_of(robot: Robot, _thread: int) -> _JointModel:
    """Return the model that a thread keeps, as using it changes it, and making it takes a hundred times as long."""
    return _JointModel(robot)
