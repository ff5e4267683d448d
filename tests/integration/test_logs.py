"""Log messages of a simulation on /rosout: their place in the sources, and how often they come."""

import signal
from pathlib import Path
from typing import Any

import pytest

from tests.commands import Command
from tests.integration.robot import ALL, ARM, OWN, QUITTING, Robot, goal
from throwcollect.ros import get_message

Log = "rcl_interfaces/msg/Log"


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
    output, _ = process.communicate(timeout=60)
    robot.wait_until(lambda: robot.node.count_publishers(robot.topic("episode")) == 0)
    (line,) = find_logged(heard, "ends: ")
    assert way in line.msg
    assert line.name.endswith(f"{OWN}.{OWN}")
    assert output.count("ends: ") == 1
