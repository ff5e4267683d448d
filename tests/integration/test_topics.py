"""Topics that come with every sample, while somebody listens."""

from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    ELBOW,
    PAUSED,
    SAMPLE_NS,
    STEP_NS,
    Robot,
    goal,
    stamp_ns,
)
from throwcollect.robots.talos import TALOS

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


def test_no_clock_message_is_repeated_while_time_stands_still(robot: Robot) -> None:
    robot.put_into(PAUSED)
    with robot.listening(KINDS["clock"], "clock") as heard:
        robot.step(20)
        robot.wait_until(lambda: bool(heard) and time_of(heard[-1]) == 20 * STEP_NS, "the last sample")
        for _ in range(5):
            robot.state()
    assert len({time_of(message) for message in heard}) == len(heard)


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
