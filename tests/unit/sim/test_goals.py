"""The goals of a trial."""

from dataclasses import replace

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.sim.present_trial import trial_goals
from throwcollect.tasks.task import task_of

CONFIG = Config()
ARM = "arm_right_controller"
TRAJECTORY = task_of(CONFIG).trajectory()
POSTURE = start_posture(CONFIG)


def test_each_moving_limb_gets_one_goal_over_all_of_its_joints() -> None:
    goals = trial_goals(TALOS, TRAJECTORY, POSTURE)
    assert list(goals) == [ARM, "torso_controller"]
    for controller, goal in goals.items():
        assert tuple(goal.trajectory.joint_names) == TALOS.controllers[controller]
        assert len(goal.trajectory.times_ns) == len(TRAJECTORY.times)


def test_a_goal_keeps_resting_joints_at_their_posture() -> None:
    arm = trial_goals(TALOS, TRAJECTORY, POSTURE)[ARM].trajectory
    still = arm.joint_names.index("arm_right_3_joint")
    for position, velocity, acceleration in zip(arm.positions, arm.velocities, arm.accelerations, strict=True):
        assert position[still] == POSTURE["arm_right_3_joint"]
        assert (velocity[still], acceleration[still]) == (0.0, 0.0)


def test_a_goal_has_the_trajectory_of_each_moving_joint() -> None:
    arm = trial_goals(TALOS, TRAJECTORY, POSTURE)[ARM].trajectory
    column, own = arm.joint_names.index("arm_right_4_joint"), TRAJECTORY.joints.index("arm_right_4_joint")
    assert np.array_equal(np.array(arm.positions)[:, column], TRAJECTORY.positions[:, own])
    assert np.array_equal(np.array(arm.velocities)[:, column], TRAJECTORY.velocities[:, own])
    assert np.allclose(np.array(arm.times_ns) / 1e9, TRAJECTORY.times, atol=1e-9)


def test_the_digest_of_a_trajectory_covers_all_its_fields() -> None:
    nudged = np.nextafter(TRAJECTORY.positions, 9.0)
    changes = [
        replace(TRAJECTORY, joints=tuple(reversed(TRAJECTORY.joints))),
        replace(TRAJECTORY, times=TRAJECTORY.times + 1e-9),
        replace(TRAJECTORY, positions=nudged),
        replace(TRAJECTORY, velocities=TRAJECTORY.accelerations),
        replace(TRAJECTORY, accelerations=TRAJECTORY.velocities),
    ]
    assert len({TRAJECTORY.digest, *(change.digest for change in changes)}) == len(changes) + 1
    assert replace(TRAJECTORY).digest == TRAJECTORY.digest
