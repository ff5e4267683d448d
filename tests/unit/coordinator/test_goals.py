from dataclasses import replace

import numpy as np

from rclzenoh.interfaces import deserialize, serialize
from throwcollect.config.schema import Config
from throwcollect.control import JointTolerance
from throwcollect.coordinator.goals import FollowJointTrajectory, goal_message, trial_goals
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.sim.controller_messages import read_goal
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
        assert len(goal.trajectory.points) == len(TRAJECTORY.times)


def test_joints_that_do_not_move_are_sent_where_they_are() -> None:
    arm = trial_goals(TALOS, TRAJECTORY, POSTURE)[ARM].trajectory
    still = arm.joint_names.index("arm_right_3_joint")
    for point in arm.points:
        assert point.positions[still] == POSTURE["arm_right_3_joint"]
        assert (point.velocities[still], point.accelerations[still]) == (0.0, 0.0)


def test_moving_joints_are_sent_their_trajectory() -> None:
    arm = trial_goals(TALOS, TRAJECTORY, POSTURE)[ARM].trajectory
    column, own = arm.joint_names.index("arm_right_4_joint"), TRAJECTORY.joints.index("arm_right_4_joint")
    sent = np.array([[point.positions[column], point.velocities[column]] for point in arm.points])
    assert np.array_equal(sent, np.stack([TRAJECTORY.positions[:, own], TRAJECTORY.velocities[:, own]], axis=1))
    stamps = [point.time_from_start_ns / 1e9 for point in arm.points]
    assert np.allclose(stamps, TRAJECTORY.times, atol=1e-9)


def test_a_goal_is_the_same_after_its_way_through_a_message() -> None:
    for goal in trial_goals(TALOS, TRAJECTORY, POSTURE).values():
        text = serialize(goal_message(goal))
        assert read_goal(deserialize(text, FollowJointTrajectory.Goal)).digest == goal.digest


def test_the_digest_of_a_goal_covers_all_that_it_says() -> None:
    goal = trial_goals(TALOS, TRAJECTORY, POSTURE)[ARM]
    trajectory, point = goal.trajectory, goal.trajectory.points[3]
    nudged = np.nextafter(np.asarray(point.positions), 9.0)
    changes = [
        replace(goal, goal_time_tolerance_ns=1),
        replace(goal, path_tolerance=[JointTolerance("arm_right_4_joint", 0.1)]),
        replace(goal, goal_tolerance=[JointTolerance("arm_right_4_joint", 0.1)]),
        replace(goal, trajectory=replace(trajectory, stamp_ns=1)),
        replace(goal, trajectory=replace(trajectory, joint_names=tuple(reversed(trajectory.joint_names)))),
        replace(goal, trajectory=replace(trajectory, points=trajectory.points[:-1])),
        *(
            replace(goal, trajectory=replace(trajectory, points=(*trajectory.points[:3], changed)))
            for changed in (
                replace(point, positions=nudged),
                replace(point, velocities=()),
                replace(point, accelerations=point.velocities),
                replace(point, effort=point.velocities),
                replace(point, time_from_start_ns=point.time_from_start_ns + 1),
            )
        ),
    ]
    assert len({goal.digest, *(change.digest for change in changes)}) == len(changes) + 1
