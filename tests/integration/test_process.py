"""How the process of a simulation begins and ends."""

import signal

import pytest

from tests.commands import Command
from tests.integration.robot import OWN, QUITTING, Result, Robot, swing

pytestmark = pytest.mark.parametrize("running", ["by itself"], indirect=True)


def assert_ends_well(process: Command) -> None:
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0, output
    assert "Traceback" not in output
    assert "rror" not in output


def test_quitting_ends_the_process_after_an_answer(running: tuple[Command, Robot]) -> None:
    process, robot = running
    assert robot.put_into(QUITTING).result == Result.RESULT_OK
    assert_ends_well(process)
    robot.wait_until(lambda: (OWN, f"/{OWN}") not in robot.node.get_node_names_and_namespaces(), "it leaves the graph")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_process_in_the_middle_of_a_run(
    number: signal.Signals, running: tuple[Command, Robot]
) -> None:
    process, robot = running
    # Slow enough to last longer than the patience of the test.
    assert robot.set({"sim.real_time_factor": 0.5}).successful
    assert robot.send(swing(60.0)).accepted
    process.send_signal(number)
    assert_ends_well(process)


def test_a_signal_ends_an_idle_process(running: tuple[Command, Robot]) -> None:
    process, _ = running
    process.send_signal(signal.SIGTERM)
    assert_ends_well(process)
