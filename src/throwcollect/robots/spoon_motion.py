"""Where the spoon is and how fast it moves, from the measured joints."""

from __future__ import annotations

import threading

import numpy as np
import pinocchio
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.robots.clearance import GRIPPER, spoon_mount
from throwcollect.robots.description import joint_model
from throwcollect.robots.spoon import ball_seat
from throwcollect.robots.talos import JOINTS


class SpoonMotion:
    """Place and velocity of the point of the spoon in which a resting ball has its centre; world frame.

    Args:
        config: Configuration of the trial.

    Raises:
        ConfigError: If Talos' files cannot be read, or the ball does not fit the spoon.
    """

    def __init__(self, config: Config) -> None:
        self._seat = spoon_mount(config.tool) * pinocchio.SE3(
            np.eye(3), np.array(ball_seat(config.tool, config.ball.radius_m))
        )
        self._robot = _robot()
        self._base = np.array([0.0, 0.0, config.robot.base_height_m])

    def place(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the point is [m], shape ``(3,)``.

        Args:
            position: Of the joints [rad], shape ``(32,)``, in the order of `talos.JOINTS`.
        """
        robot = self._robot
        pinocchio.forwardKinematics(robot.model, robot.data, position[robot.order])
        gripper = pinocchio.updateFramePlacement(robot.model, robot.data, robot.gripper)
        place: NDArray[np.float64] = self._base + (gripper * self._seat).translation
        return place

    def velocity(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """How fast the point moves [m/s], shape ``(3,)``.

        Args:
            position: Of the joints [rad], shape ``(32,)``, in the order of `talos.JOINTS`.
            velocity: Of the joints [rad/s], shape ``(32,)``.
        """
        robot = self._robot
        pinocchio.forwardKinematics(robot.model, robot.data, position[robot.order], velocity[robot.order])
        gripper = pinocchio.updateFramePlacement(robot.model, robot.data, robot.gripper)
        # Of the point, first along the axes of the seat, then along those of the world.
        along_seat = self._seat.actInv(pinocchio.getFrameVelocity(robot.model, robot.data, robot.gripper))
        turn = pinocchio.SE3((gripper * self._seat).rotation, np.zeros(3))
        velocity_in_world: NDArray[np.float64] = turn.act(along_seat).linear
        return velocity_in_world


class _Robot:
    """Talos with all joints, its kinematics, and for each of its joints the place in `talos.JOINTS`."""

    def __init__(self) -> None:
        self.model = joint_model()
        self.data = self.model.createData()
        self.order = np.array([JOINTS.index(name) for name in list(self.model.names)[1:]], dtype=np.intp)
        self.gripper = self.model.getFrameId(GRIPPER, pinocchio.BODY)


_of_thread = threading.local()


def _robot() -> _Robot:
    """The robot of this thread; to make it costs a hundred times as much as to use it."""
    if not hasattr(_of_thread, "robot"):
        _of_thread.robot = _Robot()
    robot: _Robot = _of_thread.robot
    return robot
