"""A client in the manner of PAL's play_motion2 plays motions of the real robot on an unlocked Talos.

Motions: talos_bringup/config/talos_motions.yaml of pal-robotics/talos_robot, shortened to the seconds that matter.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import pytest

from tests.integration.robot import (
    CONFIG,
    JointTrajectory,
    JointTrajectoryPoint,
    Robot,
    duration,
    running_simulation,
    stamp_ns,
)
from throwcollect.robots.talos import TALOS
from throwcollect.ros import Context, DurabilityPolicy, QoSProfile, get_action
from throwcollect.units import NS_PER_S

FollowJointTrajectory: Any = get_action("control_msgs/action/FollowJointTrajectory")
JTC = "joint_trajectory_controller/JointTrajectoryController"
APPROACH_VELOCITY = 0.5
LATEST = QoSProfile(depth=1)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORD_HZ = 50
JOINT_STATES = ("sensor_msgs/msg/JointState", "joint_states", LATEST)


def number_joints(limb: str, count: int) -> list[str]:
    return [f"{limb}_{number}_joint" for number in range(1, count + 1)]


TORSO, HEAD, GRIPPERS = (
    number_joints("torso", 2),
    number_joints("head", 2),
    ["gripper_left_joint", "gripper_right_joint"],
)
LEFT_ARM, RIGHT_ARM = number_joints("arm_left", 7), number_joints("arm_right", 7)
LEGS = [*number_joints("leg_left", 6), *number_joints("leg_right", 6)]

Motion = tuple[list[str], dict[float, list[float]]]
HOME: Motion = (
    [*TORSO, *HEAD, *LEFT_ARM, *RIGHT_ARM, *GRIPPERS],
    {2.0: [0, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 0, 0, -0.25, 0, 0, 0, 0, 0, 0, 0]},
)
HOME_LEGS: Motion = (LEGS, {5.0: [0.0] * 12})
_DOWN = [0, 0.148, 0, -0.2, 0, 0.001, 0]
_STILL = [0, -0.001, 0, -0.15, 0, -0.2, 0, 0, 0]
WAVE_LEFT: Motion = (
    [*TORSO, *RIGHT_ARM, *LEFT_ARM, "gripper_right_joint", "gripper_left_joint"],
    {
        0.0: [*_STILL, *_DOWN, 0, 0],
        3.0: [*_STILL, 0.314, 1.175, 0.927, -2.214, 0, 0.002, -0.001, 0, 0],
        4.0: [*_STILL, 0.314, 1.174, 0.927, -1.741, 0, 0.002, 0.001, 0, -0.7],
        5.0: [*_STILL, 0.314, 1.175, 0.927, -2.214, 0, 0.002, -0.001, 0, 0],
        8.0: [*_STILL, *_DOWN, 0, 0],
    },
)


class PlayMotion:
    """Plays motions as play_motion2 does: it knows the names of its joints and nothing else of the robot."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot

    def controllers(self) -> dict[str, set[str]]:
        """Active joint trajectory controllers and the joints that they claim."""
        service = "controller_manager/list_controllers"
        listed = self.robot.result(self.robot.ask("controller_manager_msgs/srv/ListControllers", service)).controller
        return {
            each.name: {interface.split("/")[0] for interface in each.claimed_interfaces}
            for each in listed
            if (each.state, each.type) == ("active", JTC)
        }

    def joint_states(self) -> dict[str, tuple[float, float, float]]:
        """Position, velocity and effort of each joint, from the sample that is the last one now, or a later one."""
        # Samples may arrive after the result of a goal that was reached later than they were taken.
        first_ns = self.robot.now_ns() - NS_PER_S // RECORD_HZ + 1
        with self.robot.listening(*JOINT_STATES) as heard:
            self.robot.wait_until(lambda: bool(heard) and stamp_ns(heard[-1].header.stamp) >= first_ns, "joint states")
        last = heard[-1]
        return {
            name: (last.position[index], last.velocity[index], last.effort[index])
            for index, name in enumerate(last.name)
        }

    def play(self, motion: Motion) -> list[tuple[int, int, str]]:
        """Play a motion; returns the results of the goals into which it was divided."""
        joints, points = motion
        first_s, first = next(iter(points.items()))
        now = self.joint_states()
        reach_s = max(abs(now[joint][0] - angle) for joint, angle in zip(joints, first, strict=True))
        late_s = max(0.0, reach_s / APPROACH_VELOCITY - first_s)
        handles = []
        for controller, claimed in self.controllers().items():
            own = sorted(claimed & set(joints))
            if not own:
                continue
            wish = FollowJointTrajectory.Goal(
                trajectory=JointTrajectory(
                    joint_names=own,
                    points=[
                        JointTrajectoryPoint(
                            positions=[float(angles[joints.index(joint)]) for joint in own],
                            time_from_start=duration(time_s + late_s),
                        )
                        for time_s, angles in points.items()
                    ],
                )
            )
            stamp = self.robot.now_ns()
            wish.trajectory.header.stamp.sec, wish.trajectory.header.stamp.nanosec = divmod(stamp, 10**9)
            handle = self.robot.send(wish, controller)
            assert handle.accepted, controller
            handles.append(handle)
        return [self.robot.outcome(handle) for handle in handles]


@pytest.fixture(scope="module")
def talos(endpoint: str, session: Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    """A simulation of a robot whose joints all move, at no more than the speed that its clients expect.

    Its steps are coarse and its messages few, as nobody counts them: it has to move for half a minute.
    """
    changes = {"robot": {"locked": "none"}, "sim": {"physics_hz": 250}, "record": {"rate_hz": RECORD_HZ}}
    config = CONFIG.model_copy(
        update={name: getattr(CONFIG, name).model_copy(update=changed) for name, changed in changes.items()}
    )
    with running_simulation(tmp_path_factory.mktemp("talos"), endpoint, session, "talos", config) as robot:
        yield robot


def test_joint_states_have_velocity_and_effort_of_every_joint(talos: Robot) -> None:
    states = PlayMotion(talos).joint_states()
    assert set(states) == set(TALOS.joints)
    # The arm holds itself against gravity.
    assert abs(states["arm_right_2_joint"][2]) > 0.1


@pytest.mark.parametrize(
    ("motion", "goals"), [(HOME, 6), (HOME_LEGS, 2), (WAVE_LEFT, 5)], ids=["home", "home_legs", "wave_left"]
)
def test_motions_of_the_real_robot_are_played(motion: Motion, goals: int, talos: Robot) -> None:
    client = PlayMotion(talos)
    assert client.play(motion) == [(4, 0, "Goal successfully reached!")] * goals
    joints, points = motion
    end = list(points.values())[-1]
    states = client.joint_states()
    assert [states[joint][0] for joint in joints] == pytest.approx(end, abs=0.02)


def test_the_head_nods_with_its_first_joint_and_turns_with_its_second(talos: Robot) -> None:
    with talos.listening("std_msgs/msg/String", "robot_description", LATCHED) as heard:
        talos.wait_until(lambda: bool(heard), "the description")
    axes = {
        joint.get("name"): joint.find("axis").get("xyz").split()
        for joint in ElementTree.fromstring(heard[0].data).iter("joint")  # noqa: S314 - our own
        if joint.get("name") in HEAD
    }
    assert [abs(float(value)) for value in axes["head_1_joint"]] == [0, 1, 0]
    assert [abs(float(value)) for value in axes["head_2_joint"]] == [0, 0, 1]
    assert PlayMotion(talos).play((HEAD, {1.0: [0.3, 0.5]})) == [(4, 0, "Goal successfully reached!")]
