"""One throw in a bare loop of pybullet."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pybullet

from bench.raw import Commands
from throwcollect.sim.world import World


def make_throw(world: World) -> Callable[[Commands], int]:
    """What runs one trial the barest way, and returns the number of steps.

    Args:
        world: Loaded, with the ball in the tool.
    """
    engine: Any = world.engine
    robot, joints, ball = engine._scenery.robot, engine._scenery.joints, engine._object_id
    state = pybullet.saveState()

    def throw(commands: Commands) -> int:
        config = commands.config
        hz, stride = config.sim.physics_hz, config.sim.physics_hz // config.record.rate_hz
        gains, damping = [config.robot.position_gain_per_s / hz] * len(joints), [1.0] * len(joints)
        plane = config.scene.landing_height_m + config.ball.radius_m
        positions, velocities = commands.positions.tolist(), commands.velocities.tolist()
        forces = commands.efforts.tolist()
        pybullet.restoreState(state)
        rows = []
        for step in range(len(velocities)):
            pybullet.setJointMotorControlArray(
                robot,
                joints,
                pybullet.POSITION_CONTROL,
                targetPositions=positions[step],
                targetVelocities=velocities[step],
                forces=forces,
                positionGains=gains,
                velocityGains=damping,
            )
            pybullet.stepSimulation()
            pressed = any(point[9] > 0 for point in pybullet.getContactPoints(ball))
            if (step + 1) % stride == 0:
                pose = pybullet.getBasePositionAndOrientation(ball)
                rows.append((pybullet.getJointStates(robot, joints), pose, pybullet.getBaseVelocity(ball)))
                if pose[0][2] < plane and not pressed:
                    break
        return step + 1

    return throw
