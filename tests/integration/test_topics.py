"""Topics that come with every sample, while somebody listens."""

import statistics
from itertools import pairwise
from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    CONFIG,
    ELBOW,
    PAUSED,
    POSTURE,
    SAMPLE_NS,
    STEP_NS,
    Robot,
    goal,
    stamp_ns,
    swing,
)
from throwcollect.robots.talos import TALOS
from throwcollect.ros import get_message

KINDS = {
    "joint_states": "sensor_msgs/msg/JointState",
    "ball/odometry": "nav_msgs/msg/Odometry",
    "tf": "tf2_msgs/msg/TFMessage",
    "clock": "rosgraph_msgs/msg/Clock",
}


def time_of(message: Any) -> int:
    if hasattr(message, "transforms"):
        return stamp_ns(message.transforms[0].header.stamp)
    return stamp_ns(message.clock if hasattr(message, "clock") else message.header.stamp)


@pytest.mark.parametrize("topic", KINDS)
def test_a_listener_gets_every_sample_in_order(topic: str, robot: Robot) -> None:
    robot.put_into(PAUSED)
    with robot.listening(KINDS[topic], topic) as heard:
        robot.step(50)
        robot.wait_until(lambda: bool(heard) and time_of(heard[-1]) == 50 * STEP_NS, "the last sample")
    times = [time_of(message) for message in heard]
    assert times == sorted(set(times))
    if topic == "clock":
        # The clock also shows where slices of the steps end, between samples.
        times = [time for time in times if time % SAMPLE_NS == 0]
    assert times == list(range(times[0], 50 * STEP_NS + 1, SAMPLE_NS))
    assert times[0] in (0, SAMPLE_NS)


def test_samples_in_real_time_are_sent_at_their_time(robot: Robot) -> None:
    left: list[int] = []

    def note(_message: Any, info: Any) -> None:
        left.append(int(info["source_timestamp"]))

    assert robot.set({"sim.real_time_factor": 1.0}).successful
    kind = get_message(KINDS["joint_states"])
    subscription = robot.node.create_subscription(kind, robot.topic("joint_states"), note, 10)
    robot.state()
    assert robot.outcome(robot.send(swing(1.0)))[1] == 0
    robot.node.destroy_subscription(subscription)
    gaps = [later - before for before, later in pairwise(left)]
    # If all samples of a slice of 50 ms were sent together, most gaps would be below 0.1 ms.
    assert statistics.median(gaps) == pytest.approx(SAMPLE_NS, rel=0.5)


def test_no_clock_message_is_repeated_while_time_stands_still(robot: Robot) -> None:
    robot.put_into(PAUSED)
    with robot.listening(KINDS["clock"], "clock") as heard:
        robot.step(20)
        robot.wait_until(lambda: bool(heard) and time_of(heard[-1]) == 20 * STEP_NS, "the last sample")
        for _ in range(5):
            robot.state()
    assert len({time_of(message) for message in heard}) == len(heard)


def test_joint_states_hold_all_joints_and_follow_a_motion(robot: Robot) -> None:
    with robot.listening(KINDS["joint_states"], "joint_states") as heard:
        robot.outcome(robot.send(goal(ARM, 0.5, arm_right_4_joint=-1.0)))
        robot.wait_until(lambda: bool(heard) and time_of(heard[-1]) >= 500_000_000, "samples of the whole motion")
    first, last = heard[0], heard[-1]
    assert tuple(first.name) == TALOS.joints
    assert len(first.position) == len(first.velocity) == len(first.effort) == 32
    column = TALOS.joints.index(ELBOW)
    assert first.position[column] == pytest.approx(POSTURE[ELBOW], abs=1e-3)
    assert last.position[column] == pytest.approx(-1.0, abs=0.005)
    assert max(message.velocity[column] for message in heard) > 1.0


def test_odometry_of_the_ball_covers_its_flight_and_landing(robot: Robot) -> None:
    # As fast as it can, a simulation sends faster than a busy machine reads, and what a connection cannot take is lost.
    changes = {"sim.real_time_factor": 1.0, "trial.number": 0, "trial.controllers": [ARM]}
    assert robot.set(changes).successful
    robot.reset()
    start_ns = CONFIG.trial_start_ns(0)
    with (
        robot.listening(KINDS["ball/odometry"], "ball/odometry") as heard,
        robot.listening("std_msgs/msg/UInt8MultiArray", "episode") as episodes,
    ):
        robot.send(swing())
        robot.wait_until(lambda: bool(episodes), "the episode")
        # Samples are sent before the episode that they are part of, but may be overtaken by it on the way.
        robot.wait_until(lambda: heard[-1].pose.pose.position.z <= CONFIG.ball.radius_m, "the last sample")
    heights = [message.pose.pose.position.z for message in heard]
    assert max(heights) > heights[0] + 0.1
    assert heard[0].header.frame_id == "world"
    assert heard[0].child_frame_id == "ball"
    assert time_of(heard[-1]) > start_ns + 10**9


def test_a_listener_gets_the_controller_state_of_every_control_period(robot: Robot) -> None:
    # As fast as it can, a simulation sends faster than a busy machine reads, and what a connection cannot take is lost.
    assert robot.set({"sim.real_time_factor": 1.0}).successful
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    with robot.listening(kind, f"{ARM}/controller_state") as heard:
        robot.outcome(robot.send(goal(ARM, 0.5, arm_right_4_joint=-1.0)))
        robot.wait_until(lambda: bool(heard) and time_of(heard[-1]) >= 490_000_000, "the last state")
    times = [time_of(message) for message in heard if time_of(message) > 0]
    assert times[:240] == [STEP_NS * number for number in range(1, 241)]
    last = heard[-1]
    assert tuple(last.joint_names) == TALOS.controllers[ARM]
    column = TALOS.controllers[ARM].index(ELBOW)
    assert last.reference.positions[column] == pytest.approx(-1.0, abs=1e-3)
    assert last.feedback.positions[column] == pytest.approx(-1.0, abs=0.01)
    assert last.output.positions[column] == pytest.approx(-1.0, abs=1e-3)
    assert len(last.reference.accelerations) == len(last.joint_names)
    assert len(last.reference.effort) == 0
    assert last.speed_scaling_factor == 1.0
