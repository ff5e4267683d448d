"""Dynamics and kinematics of a robot with a tool: torques that a motion needs, and the motion of the tool."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.robots.description import joint_offsets, robot_of
from throwcollect.robots.joint_model import joint_model, lock_joints, mount_of
from throwcollect.robots.robot import Robot, joint_limits
from throwcollect.robots.surroundings import object_of, starts_in_tool
from throwcollect.robots.tools.tool import Tool, tool_of


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

    def compute_efforts(self, config: Config, tool: Tool, motion: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
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


class ToolMotion:
    """Position and velocity of the seat in the world; the seat is the centre of a ball that rests in the tool."""

    def __init__(self, config: Config) -> None:
        tool = tool_of(config)
        self._seat = mount_of(robot_of(config), tool) * pinocchio.SE3(
            np.eye(3), np.array(tool.ball_seat(object_of(config).radius_m))
        )
        self._model, self._data, self._order = _model_of(robot_of(config), threading.get_ident())
        self._hand = self._model.getFrameId(robot_of(config).hand, pinocchio.BODY)
        self._offsets = joint_offsets(config)
        self._base = np.array([0.0, 0.0, config.robot.base_height_m])

    def place(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the position of the seat [m], shape ``(3,)``, from positions of `Robot.joints` [rad]."""
        pinocchio.forwardKinematics(self._model, self._data, (position + self._offsets)[self._order])
        hand = pinocchio.updateFramePlacement(self._model, self._data, self._hand)
        place: NDArray[np.float64] = self._base + (hand * self._seat).translation
        return place

    def velocity(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the velocity of the seat [m/s], ``(3,)``, from positions and velocities of `Robot.joints` [rad/s]."""
        model, data, actual = self._model, self._data, position + self._offsets
        pinocchio.forwardKinematics(model, data, actual[self._order], velocity[self._order])
        hand = pinocchio.updateFramePlacement(model, data, self._hand)
        # The velocity of the seat, first along the axes of the seat, then along those of the world.
        along_seat = self._seat.actInv(pinocchio.getFrameVelocity(model, data, self._hand))
        turn = pinocchio.SE3((hand * self._seat).rotation, np.zeros(3))
        velocity_in_world: NDArray[np.float64] = turn.act(along_seat).linear
        return velocity_in_world


@lru_cache(maxsize=64)
def _model_of(robot: Robot, _thread: int) -> tuple[pinocchio.Model, pinocchio.Data, NDArray[np.intp]]:
    """Return the model of all joints that a thread keeps, and the place of each joint of it in `Robot.joints`.

    Using its data changes them, and making them takes a hundred times as long.
    """
    model = joint_model(robot)
    order = np.array([robot.joints.index(name) for name in list(model.names)[1:]], dtype=np.intp)
    return model, model.createData(), order
