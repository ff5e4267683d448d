"""Log messages of a simulation on /rosout: their place in the sources, and how often they come."""

import signal
from pathlib import Path
from typing import Any

import pytest

from tests.commands import Command
from tests.integration.robot import ALL, ARM, OWN, QUITTING, Robot, goal
from throwcollect.ros import DurabilityPolicy, Parameter, QoSProfile, get_message

Log = "rcl_interfaces/msg/Log"
SpeedScalingFactor: Any = get_message("control_msgs/msg/SpeedScalingFactor")

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The profile of the simulation's subscription to speeds; on DDS it would not hear less durable publishers."""


def find_logged(heard: list[Any], words: str) -> list[Any]:
    return [each for each in heard if words in each.msg]


def settle(robot: Robot) -> None:
    """Wait for a few more answers: everything logged before the first one has then arrived."""
    for _ in range(5):
        robot.state()


def test_a_refused_goal_logs_one_line_with_its_place_in_the_sources(robot: Robot) -> None:
    with robot.listening(Log, "/rosout") as heard:
        for _ in range(3):
            assert not robot.send(goal(ARM, 0.0)).accepted
        settle(robot)
    lines = find_logged(heard, "not strictly increasing")
    assert len(lines) == 3
    assert (Path(lines[0].file).name, lines[0].function) == ("controller.py", "_find_refusal")
    assert lines[0].line > 0


def test_speeds_that_are_refused_do_not_flood_the_log(robot: Robot) -> None:
    with robot.listening(Log, "/rosout") as heard:
        publisher = robot.node.create_publisher(SpeedScalingFactor, robot.topic(f"{ARM}/speed_scaling_input"), LATCHED)
        robot.wait_until(lambda: publisher.get_subscription_count() > 0)
        for number in range(50):
            publisher.publish(SpeedScalingFactor(factor=-1.0 - number))
        settle(robot)
        robot.node.destroy_publisher(publisher)
    lines = find_logged(heard, "Scaling factor has to be")
    assert 1 <= len(lines) <= 2
    assert "0 to 1000" in lines[0].msg
    assert (Path(lines[0].file).name, lines[0].function) == ("controller.py", "scale_speed")


def test_an_ineffective_parameter_is_logged_once_per_request(robot: Robot) -> None:
    wanted = [Parameter("cmd_timeout", value=0.1)]
    wanted += [Parameter(f"constraints.arm_right_{number}_joint.goal", value=0.03) for number in range(1, 8)]
    with robot.listening(Log, "/rosout") as heard:
        messages = [each.to_parameter_msg() for each in wanted]
        results = robot.parameters("set_parameters", node=ARM, parameters=messages).results
        assert all(each.successful for each in results)
        settle(robot)
    assert len(find_logged(heard, "Command timeout must be higher than goal_time tolerance (0.1 vs. 0.6)")) == 1
    undone = [Parameter("cmd_timeout", value=0.0), *(Parameter(each.name, value=0.02) for each in wanted[1:])]
    robot.parameters("set_parameters", node=ARM, parameters=[each.to_parameter_msg() for each in undone])


@pytest.mark.parametrize("way", ["a client", "SIGTERM"])
def test_a_simulation_says_why_it_ends(way: str, running: tuple[Command, Robot]) -> None:
    process, robot = running
    heard: list[Any] = []
    robot.node.create_subscription(get_message(Log), "/rosout", heard.append, ALL)
    robot.state()
    if way == "SIGTERM":
        process.send_signal(signal.SIGTERM)
    else:
        robot.put_into(QUITTING)
    robot.wait_until(lambda: bool(find_logged(heard, "ends: ")), "a last word")
    output, _ = process.communicate(timeout=10)
    robot.wait_until(lambda: robot.node.count_publishers(robot.topic("episode")) == 0)
    (line,) = find_logged(heard, "ends: ")
    assert way in line.msg
    assert line.name.endswith(f"{OWN}.{OWN}")
    assert output.count("ends: ") == 1
