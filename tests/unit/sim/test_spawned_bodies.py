"""Bodies that clients spawn while no trial runs: they take part in physics, and nothing of them reaches a trial."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.engine import BodyState
from throwcollect.errors import ConfigError
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.plan.trials import Trial
from throwcollect.robots.body_files import place_spawned, read_spawned
from throwcollect.ros.msg import Result, SimulatorFeatures
from throwcollect.ros.nodes.simulation.control import SimulationControl
from throwcollect.ros.nodes.simulation.spawning import SpawningServices
from throwcollect.sim.live import LiveSimulator, StateCode
from throwcollect.sim.simulator import Simulator

CUBE = """
<robot name="cube"><link name="cube">
  <inertial><mass value="0.2"/><inertia ixx="0.0003" ixy="0" ixz="0" iyy="0.0003" iyz="0" izz="0.0003"/></inertial>
  <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
</link></robot>
"""
TRIAL = Trial(0, {}, 1, "")


class Services:
    """The services of a simulation, called without messages."""

    def __init__(self, simulation: LiveSimulator) -> None:
        self._answers: dict[str, tuple[Any, Callable[[Any, Any], Any]]] = {}
        node: Any = self
        SimulationControl(node, simulation)
        SpawningServices(node, simulation)

    def create_service(self, kind: Any, name: str, answer: Callable[[Any, Any], Any]) -> None:
        self._answers[name] = kind, answer

    def __call__(self, service: str, /, **request: Any) -> Any:
        kind, answer = self._answers[service]
        return answer(kind.Request(**request), kind.Response())


@pytest.fixture(params=["bullet", "mujoco"])
def simulation(request: pytest.FixtureRequest) -> Iterator[LiveSimulator]:
    pytest.importorskip(ENGINE_PACKAGES[request.param].module)
    table = {"shape": "box", "size_m": [0.4, 0.4, 0.1], "position_m": [1.5, -1.0, 0.5]}
    scene = {"landing_height_m": 0.1, "bodies": {"table": table}}
    made = LiveSimulator(Config.model_validate({"sim": {"engine": request.param}, "scene": scene}))
    yield made
    made.close()


def at(x: float, y: float, z: float) -> Any:
    from throwcollect.ros.msg import Point, Pose, PoseStamped, Quaternion

    return PoseStamped(pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=1.0)))


def step(simulation: LiveSimulator, steps: int) -> None:
    simulation.state = StateCode.PAUSED
    simulation.request_steps(steps)
    while simulation.running:
        simulation.advance(watched=True)


def test_a_spawned_body_falls_on_the_scene_and_everything_else_stays(simulation: LiveSimulator) -> None:
    call = Services(simulation)
    before = simulation.world.bodies["ball"].position
    answer = call("spawn_entity", name="cube", resource_string=CUBE, initial_pose=at(1.5, -1.0, 0.7))
    assert (answer.result.result, answer.entity_name) == (Result.RESULT_OK, "cube")
    assert simulation.world.bodies["ball"].position == pytest.approx(before, abs=1e-9)
    step(simulation, 500)
    states = simulation.world.bodies
    assert states["cube"].position == pytest.approx((1.5, -1.0, 0.6), abs=2e-3)
    assert states["ball"].position == pytest.approx(before, abs=1e-4)
    # A second one leaves the first one where it is.
    second = call(
        "spawn_entity", name="cube", resource_string=CUBE, initial_pose=at(1.5, -1.0, 0.8), allow_renaming=True
    )
    assert second.entity_name == "cube_1"
    assert simulation.world.bodies["cube"].position == pytest.approx(states["cube"].position, abs=1e-6)
    copy = call("spawn_entity", uri="table", name="shelf", initial_pose=at(1.5, 1.0, 1.0))
    assert copy.entity_name == "shelf"
    assert call("get_entities").entities == ["ball", "cube", "cube_1", "table", "shelf", "talos"]
    assert call("delete_entity", entity="cube").result.result == Result.RESULT_OK
    assert "cube" not in simulation.world.bodies
    assert len(simulation.fresh_samples()) == 1


def test_nothing_of_a_spawned_body_reaches_a_trial(simulation: LiveSimulator) -> None:
    alone = Simulator(simulation.config)
    expected = alone.run(TRIAL)
    alone.close()
    x, y, z = simulation.world.bodies["ball"].position
    # In the way of the throw.
    wall = place_spawned(read_spawned(CUBE), "wall", BodyState((x + 0.3, y, z + 0.3)))
    simulation.spawn(wall)
    step(simulation, 50)
    simulation.state = StateCode.PLAYING
    episode = simulation.run(TRIAL)
    assert episode.digest == expected.digest
    assert not simulation.spawned
    assert "wall" not in simulation.world.bodies


def test_a_scope_of_a_reset_removes_what_was_spawned(simulation: LiveSimulator) -> None:
    call = Services(simulation)
    for scope, number in ((1, 1), (4, 0), (2, 0), (0, 0)):
        call("spawn_entity", name="cube", resource_string=CUBE, initial_pose=at(1.5, -1.0, 0.7))
        assert call("reset_simulation", scope=scope).result.result == Result.RESULT_OK
        assert len(simulation.spawned) == number
        simulation.reset()


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ({"name": "Cube"}, "NAME_INVALID"),
        ({"name": "talos"}, "NAME_NOT_UNIQUE"),
        ({"resource_string": "<sdf/>"}, "RESOURCE_PARSE_ERROR"),
        ({"initial_pose": at(float("nan"), 0, 0)}, "INVALID_POSE"),
    ],
)
def test_what_cannot_be_spawned_is_refused_with_its_reason(
    shared: LiveSimulator, request_: dict[str, Any], reason: str
) -> None:
    call = Services(shared)
    wanted = {"name": "cube", "resource_string": CUBE, "initial_pose": at(1.5, -1.0, 0.7), **request_}
    answer = call("spawn_entity", **wanted)
    assert answer.result.result == getattr(type(answer), reason)
    assert answer.result.error_message
    assert not shared.spawned


@pytest.fixture(scope="module")
def shared() -> Iterator[LiveSimulator]:
    table = {"shape": "box", "size_m": [0.4, 0.4, 0.1], "position_m": [1.5, -1.0, 0.5]}
    made = LiveSimulator(Config.model_validate({"scene": {"bodies": {"table": table}}}))
    yield made
    made.close()


def test_only_what_was_spawned_is_deleted(shared: LiveSimulator) -> None:
    call = Services(shared)
    assert [each.uri for each in call("get_spawnables").spawnables] == ["table"]
    assert SimulatorFeatures.SPAWNING in call("get_simulator_features").features.features
    for name, code in (("table", Result.RESULT_OPERATION_FAILED), ("rack", Result.RESULT_NOT_FOUND)):
        assert call("delete_entity", entity=name).result.result == code


def test_an_engine_without_contacts_keeps_its_world() -> None:
    simulation = LiveSimulator(Config.model_validate({"sim": {"engine": "ballistic"}}))
    before = simulation.world.engine.state
    with pytest.raises(ConfigError, match="knows no contacts: cube"):
        simulation.spawn(place_spawned(read_spawned(CUBE), "cube", BodyState((1.0, 0.0, 1.0))))
    assert np.array_equal(simulation.world.engine.state.sample, before.sample)
    assert not simulation.spawned
    simulation.close()
