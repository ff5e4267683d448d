"""How motors follow joint commands: exact feed-forward, effort limits, and a delay of the commands."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import pybullet

from throwcollect.config.schema import Config
from throwcollect.robots.model import joint_limits
from throwcollect.robots.talos import JOINTS


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
        self._recent = deque([start], maxlen=int(delay) + 2)
        self._recent.extend([start] * (int(delay) + 1))
        self.target: Sequence[float] = start
        """Position wanted at the end of the last step [rad], after the delay."""

    def follow(self, command: Sequence[float]) -> None:
        """Aim the motors for the next step.

        Args:
            command: Position wanted at its end [rad], one number a moving joint, before the delay.
        """
        self._recent.append(command)
        before = self.target
        self.target = self._recent[1]
        if self._fraction:
            late, now = self._fraction, 1 - self._fraction
            self.target = [now * b + late * a for a, b in zip(self._recent[0], self._recent[1], strict=True)]
        hz = self._hz
        pybullet.setJointMotorControlArray(
            self._robot,
            self._joints,
            pybullet.POSITION_CONTROL,
            targetPositions=before,
            targetVelocities=[(b - a) * hz for a, b in zip(before, self.target, strict=True)],
            forces=self._forces,
            positionGains=self._position_gains,
            velocityGains=self._velocity_gains,
            physicsClientId=self._client,
        )
