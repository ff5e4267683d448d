"""How motors follow joint commands: exact feed-forward, effort limits, and a delay of the commands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.robots.model import joint_limits
from throwcollect.robots.talos import JOINTS

Aim = tuple[list[float], list[float], list[float]]
"""What matters to the motors in one step, one number a moving joint: the position wanted at its beginning [rad], the
velocity that leads from there to the target [rad/s], and the target, the position wanted at its end [rad]."""


class Motors:
    """The motors of the moving joints, from one step to the next.

    A command is the position wanted at the end of a step. The motor is told to be where it should be at the beginning
    of the step and to have the speed that leads from there to the command, so that it follows without lag.

    Args:
        client: Physics client.
        robot: Body number of the robot.
        joints: Numbers of the moving joints.
        moving: Their names.
        start: Position that they hold before the first command [rad].
        config: Of it, ``robot`` and ``sim`` matter.
    """

    def __init__(
        self,
        client: int,
        robot: int,
        joints: list[int],
        *,
        moving: Sequence[str],
        start: Sequence[float],
        config: Config,
    ) -> None:
        self._client, self._robot, self._joints = client, robot, joints
        self._hz = float(config.sim.physics_hz)
        effort = joint_limits().effort * config.robot.effort_scale
        self._forces = [float(effort[JOINTS.index(joint)]) for joint in moving]
        self._position_gains = [config.robot.position_gain_per_s / self._hz] * len(joints)
        self._velocity_gains = [config.robot.velocity_gain] * len(joints)
        delay = config.sim.command_delay_s * self._hz
        self._fraction = delay % 1
        # The commands that will still act: as many as the delay is long, and one more to interpolate from.
        self._acting = np.tile(np.array(start, dtype=float), (int(delay) + 1, 1))
        self._targets = self._acting[:1]
        self._planned = self._acting

    @property
    def target(self) -> list[float]:
        """Position wanted at the end of the last step [rad], after the delay."""
        target: list[float] = self._targets[0].tolist()
        return target

    def plan(self, commands: NDArray[np.float64]) -> Iterable[Aim]:
        """Work out how to aim for each of the next steps; `advance` then says how many of them were taken.

        Args:
            commands: Position wanted at the end of each step [rad], before the delay, shape ``(n_steps, n_moving)``.
        """
        count = len(commands)
        self._planned = np.concatenate((self._acting, commands))
        targets = self._planned[1 : count + 1]
        if self._fraction:
            targets = (1 - self._fraction) * targets + self._fraction * self._planned[:count]
        self._targets = np.concatenate((self._targets[:1], targets))
        velocities = np.diff(self._targets, axis=0) * self._hz
        lists = self._targets.tolist()
        # Lists, as Bullet reads them twice as fast as arrays.
        return zip(lists[:-1], velocities.tolist(), lists[1:], strict=True)

    def advance(self, steps: int) -> None:
        """Go on by so many of the steps that were planned."""
        self._acting = self._planned[steps : steps + len(self._acting)]
        self._targets = self._targets[steps : steps + 1]

    def aim(self, position: list[float], velocity: list[float]) -> None:
        """Aim the motors for the next step.

        Args:
            position: Position wanted at the beginning of the step, one number a moving joint [rad].
            velocity: Velocity that leads from there to the target [rad/s].
        """
        # By position: Bullet takes longer to find nine arguments by their names than to set the motors.
        pybullet.setJointMotorControlArray(
            self._robot,
            self._joints,
            pybullet.POSITION_CONTROL,
            position,
            velocity,
            self._forces,
            self._position_gains,
            self._velocity_gains,
            self._client,
        )
