"""A simulation on an engine that knows only robot, ground and ball."""

from collections.abc import Iterator

import pytest

from tests.integration.robot import Robot, running_simulation, swing
from throwcollect.config.schema import Config
from throwcollect.ros import Context


@pytest.fixture(scope="module")
def kinematic(tmp_path_factory: pytest.TempPathFactory, endpoint: str, session: Context) -> Iterator[Robot]:
    config = Config.model_validate({"sim": {"engine": "ballistic"}})
    directory = tmp_path_factory.mktemp("kinematic")
    with running_simulation(directory, endpoint, session, "kinematic", config) as robot:
        yield robot


def test_a_simulation_on_the_ballistic_engine_carries_out_goals(kinematic: Robot) -> None:
    assert kinematic.outcome(kinematic.send(swing(0.3)))[1] == 0
    assert kinematic.joint("arm_right_4_joint") == pytest.approx(-0.5, abs=1e-9)
