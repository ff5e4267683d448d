"""ManiSkill 3 on its CPU backend: its Panda with its controllers, and an environment with a ball."""

from __future__ import annotations

import harness
import numpy as np
import sapien
import torch
from mani_skill.envs.sapien_env import BaseEnv

_OPEN, _CLOSE = 1.0, -1.0


class ThrowEnv(BaseEnv):
    """A Panda that holds a ball, without tasks and rewards."""

    SUPPORTED_ROBOTS = ("panda",)
    start = (0.0,) * 7

    def _load_agent(self, options):
        super()._load_agent(options, sapien.Pose([0, 0, harness.BASE_HEIGHT_M]))

    def _load_scene(self, _options):
        ground = self.scene.create_actor_builder()
        ground.add_plane_collision(sapien.Pose(q=[0.7071068, 0, -0.7071068, 0]))
        ground.initial_pose = sapien.Pose()
        ground.build_static("ground")
        builder = self.scene.create_actor_builder()
        density = harness.BALL_KG / (4 / 3 * np.pi * harness.BALL_RADIUS_M**3)
        builder.add_sphere_collision(radius=harness.BALL_RADIUS_M, density=density)
        builder.initial_pose = sapien.Pose([1, 0, 1])
        self.ball = builder.build("ball")

    def _initialize_episode(self, _env_idx, _options):
        self.agent.robot.set_qpos(np.array([*self.start, *[harness.BALL_RADIUS_M] * 2]))
        self.ball.set_pose(self.agent.tcp.pose)


def make_run(_threads):
    torch.set_num_threads(1)
    env = ThrowEnv(
        robot_uids="panda",
        obs_mode="none",
        reward_mode="none",
        control_mode="pd_joint_pos_vel",
        sim_backend="physx_cpu",
        render_backend="none",
        sim_config={"sim_freq": harness.PHYSICS_HZ, "control_freq": harness.RECORD_HZ},
    )
    # Reading the objects of SAPIEN is faster than making observations of tensors.
    (robot,), (ball,) = env.agent.robot._objs, env.ball._bodies

    def throw(trial):
        env.start = trial.positions[0]
        env.reset()
        positions = trial.positions[:: harness.STRIDE]
        actions = np.empty((len(positions) - 1, 15), dtype=np.float32)
        actions[:, :7], actions[:, 7:14] = positions[1:], np.diff(positions, axis=0) * harness.RECORD_HZ
        actions[:, 14] = np.where(np.arange(len(actions)) * harness.STRIDE < trial.release, _CLOSE, _OPEN)
        rows = []
        for action in torch.from_numpy(actions):
            env.step(action)
            pose = ball.pose
            rows.append((robot.qpos[:7], robot.qvel[:7], pose.p, pose.q, ball.linear_velocity, ball.angular_velocity))
        return np.array([np.concatenate(row) for row in rows])

    return harness.one_by_one(throw)


if __name__ == "__main__":
    harness.main(make_run)
