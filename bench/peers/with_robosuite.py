"""robosuite: its Panda with its gripper and its joint position controller, and an environment with a ball.

Observables are off, and samples are read from the simulation, as making observations takes longer than that.
"""

from __future__ import annotations

import harness
import numpy as np
from robosuite.controllers import load_composite_controller_config
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import EmptyArena
from robosuite.models.objects import BallObject
from robosuite.models.tasks import ManipulationTask

_STIFFNESS, _OPEN, _CLOSE = 4e4, -1.0, 1.0


class ThrowEnv(ManipulationEnv):
    """A Panda that holds a ball, above an empty floor."""

    def _load_model(self):
        super()._load_model()
        robot = self.robots[0].robot_model
        robot.set_base_xpos([0, 0, harness.BASE_HEIGHT_M])
        # Its links have rough inertias, with which motors of the real torques do not follow the motion.
        for motor in robot.actuator.findall("motor"):
            motor.set("ctrlrange", "-400 400")
        volume = 4 / 3 * np.pi * harness.BALL_RADIUS_M**3
        self.ball = BallObject("ball", size=[harness.BALL_RADIUS_M], density=harness.BALL_KG / volume)
        self.model = ManipulationTask(EmptyArena(), [robot], [self.ball])

    def reward(self, _action=None):
        """Say what every environment has to; nothing is learnt here."""
        return 0.0


def make_env():
    """Make the environment, without cameras and observables."""
    controller = load_composite_controller_config(robot="Panda")
    arm = controller["body_parts"]["right"]
    arm |= {"type": "JOINT_POSITION", "input_type": "absolute", "kp": _STIFFNESS, "interpolation": None}
    env = ThrowEnv(
        "Panda",
        controller_configs=controller,
        base_types="NullMount",
        use_camera_obs=False,
        has_offscreen_renderer=False,
        control_freq=harness.RECORD_HZ,
        ignore_done=True,
        hard_reset=False,
    )
    for name in env.observation_names:
        env.modify_observable(name, "enabled", False)
    return env


def hold_ball(env, start):
    """Put the arm to its start, and the ball between the fingers."""
    data, robot = env.sim.data, env.robots[0]
    data.qpos[robot._ref_joint_pos_indexes] = start
    data.qpos[robot._ref_gripper_joint_pos_indexes["right"]] = harness.BALL_RADIUS_M, -harness.BALL_RADIUS_M
    env.sim.forward()
    grip = data.get_site_xpos(robot.gripper["right"].important_sites["grip_site"])
    data.set_joint_qpos(env.ball.joints[0], [*grip, 1, 0, 0, 0])
    env.sim.forward()


def make_run(_threads):
    env = make_env()
    data, robot = env.sim.data, env.robots[0]
    joints, speeds = robot._ref_joint_pos_indexes, robot._ref_joint_vel_indexes

    def throw(trial):
        env.reset()
        hold_ball(env, trial.positions[0])
        rows, actions = [], np.empty((len(trial.positions) // harness.STRIDE, 8))
        actions[:, :7] = trial.positions[harness.STRIDE :: harness.STRIDE]
        actions[:, 7] = np.where(np.arange(len(actions)) * harness.STRIDE < trial.release, _CLOSE, _OPEN)
        for action in actions:
            env.step(action)
            rows.append((data.qpos.copy(), data.qvel.copy()))
        qpos, qvel = map(np.array, zip(*rows, strict=True))
        # The joint of the ball is the last one.
        return np.hstack([qpos[:, joints], qvel[:, speeds], qpos[:, -7:], qvel[:, -6:]])

    return harness.one_by_one(throw)


if __name__ == "__main__":
    harness.main(make_run)
