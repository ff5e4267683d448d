import numpy as np

from throwcollect.config.schema import Config
from throwcollect.coordinator.goals import trial_goals
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import CONTROLLERS
from throwcollect.tasks.trajectory import throw_trajectory

CONFIG = Config()
TRAJECTORY = throw_trajectory(CONFIG)
POSTURE = start_posture(CONFIG)


def test_each_moving_limb_gets_one_goal_over_all_of_its_joints() -> None:
    goals = trial_goals(TRAJECTORY, POSTURE)
    assert goals.controllers == ("arm_right_controller", "torso_controller")
    for controller, goal in zip(goals.controllers, goals.goals, strict=True):
        assert tuple(goal.trajectory.joint_names) == CONTROLLERS[controller]
        assert len(goal.trajectory.points) == len(TRAJECTORY.times)


def test_joints_that_do_not_move_are_sent_where_they_are() -> None:
    arm = trial_goals(TRAJECTORY, POSTURE).goals[0].trajectory
    still = arm.joint_names.index("arm_right_3_joint")
    for point in arm.points:
        assert point.positions[still] == POSTURE["arm_right_3_joint"]
        assert (point.velocities[still], point.accelerations[still]) == (0.0, 0.0)


def test_moving_joints_are_sent_their_trajectory() -> None:
    arm = trial_goals(TRAJECTORY, POSTURE).goals[0].trajectory
    column, own = arm.joint_names.index("arm_right_4_joint"), TRAJECTORY.joints.index("arm_right_4_joint")
    sent = np.array([[point.positions[column], point.velocities[column]] for point in arm.points])
    assert np.array_equal(sent, np.stack([TRAJECTORY.positions[:, own], TRAJECTORY.velocities[:, own]], axis=1))
    stamps = [point.time_from_start.sec + point.time_from_start.nanosec / 1e9 for point in arm.points]
    assert np.allclose(stamps, TRAJECTORY.times, atol=1e-9)
