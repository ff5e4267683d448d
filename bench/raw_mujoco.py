"""One throw in a bare loop of MuJoCo: its own step and contacts, torques by gains and MuJoCo's own bias forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from bench.raw import Commands
from throwcollect.sim.world import World

_POSITION_GAIN, _VELOCITY_GAIN = 2000.0, 200.0
"""[Nm/rad], [Nm s/rad]: joints stay within some mrad of their trajectory."""


def make_throw(world: World) -> Callable[[Commands], int]:
    """What runs one trial the barest way, and returns the number of steps.

    Args:
        world: Loaded, with the ball in the tool.
    """
    engine: Any = world.engine
    model, data, columns = engine._model, engine._data, engine._columns
    start = engine.state
    joints = len(columns)
    # Contacts at a distance, to which throwcollect gives targets of its own, would throw the ball out of the tool.
    model.geom_margin[:] = 0.0

    def throw(commands: Commands) -> int:
        config = commands.config
        stride = config.sim.physics_hz // config.record.rate_hz
        plane = config.scene.landing_height_m + config.ball.radius_m
        most = commands.efforts[columns]
        position, velocity, bias = data.qpos[:joints], data.qvel[:joints], data.qfrc_bias[:joints]
        targets, speeds = commands.positions[1:, columns], commands.velocities[:, columns]
        engine.reset(start)
        rows = []
        for step, (target, speed) in enumerate(zip(targets, speeds, strict=True), start=1):
            torque = bias + _POSITION_GAIN * (target - position) + _VELOCITY_GAIN * (speed - velocity)
            data.qfrc_applied[:joints] = np.clip(torque, -most, most)
            mujoco.mj_step(model, data)
            if step % stride == 0:
                rows.append((data.qpos.tolist(), data.qvel.tolist(), data.qfrc_applied.tolist()))
                if data.qpos[joints + 2] < plane:
                    break
        return step

    return throw
