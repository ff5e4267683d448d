"""What clients do with a simulation, recorded into a dataset."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import throwcollect
from tests.integration.robot import ARM, CONFIG, ELBOW, OWN, POSTURE, Robot, goal, start_simulation, swing
from throwcollect.control.values import GoalStatus
from throwcollect.robots.talos import TALOS
from throwcollect.ros import Context


@pytest.fixture
def recorder(endpoint: str, session: Context, tmp_path: Path) -> Iterator[tuple[Robot, Path]]:
    directory = tmp_path / "recorded"
    process = start_simulation(tmp_path, endpoint, OWN, options=("--record", str(directory)))
    try:
        robot = Robot(session, OWN)
        robot.wait_until_ready(process)
        yield robot, directory
    finally:
        process.kill()
        process.communicate()
    robot.wait_until_gone()
    robot.node.destroy_node()


def record(robot: Robot, begin: bool) -> tuple[bool, str]:
    response = robot.result(robot.ask("std_srvs/srv/SetBool", "record", data=begin))
    return response.success, response.message


def test_client_records_episodes(recorder: tuple[Robot, Path]) -> None:
    robot, directory = recorder
    assert not directory.exists()
    assert record(robot, False) == (False, "nothing is recorded: no recording was begun, or a reset ended it")
    assert record(robot, True) == (True, f"records for at most 6 s into {directory}")
    assert record(robot, True) == (False, "a recording runs already")
    assert record(robot, False) == (False, "nothing has moved, so nothing was written")

    # The first episode ends with the throw, the second one when its client says so, after a pause.
    record(robot, True)
    robot.send(swing())
    robot.wait_until((directory / "metadata.yaml").exists, "an episode is written")
    success, thrown = record(robot, False)
    assert success, thrown
    record(robot, True)
    for change in (0.1, 0.2):
        wish = goal(ARM, 0.5, **{ELBOW: POSTURE[ELBOW] + change})
        # Without its first point, a trajectory begins where the arm is.
        del wish.trajectory.points[0]
        assert robot.outcome(robot.send(wish))[0] == GoalStatus.SUCCEEDED
    success, told = record(robot, False)
    assert success, told

    dataset = throwcollect.load(directory)
    assert dataset.throws["trial"].to_pylist() == [0, 1]
    assert thrown.startswith(f"trial 0: {dataset.throws['outcome'][0]}")
    assert told.startswith(f"trial 1: {dataset.throws['outcome'][1]}")

    # What was sent is the action of exports, one frame ahead of what was measured.
    _, samples = dataset.throw(1).read_samples()
    elbow = CONFIG.moving_joints.index(ELBOW)
    measured = samples.position[:, TALOS.joints.index(ELBOW)]
    assert np.abs(samples.command[:-1, 1, elbow] - measured[1:]).max() < 1e-3
    assert np.ptp(measured) > 0.1
