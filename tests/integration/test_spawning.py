"""Bodies that a client puts into the world of a session by messages."""

from __future__ import annotations

from typing import Any

import pytest

from tests.integration.robot import PAUSED, Result, Robot
from tests.unit.sim.test_spawned_bodies import CUBE, at
from throwcollect.ros import get_message

Features: Any = get_message("simulation_interfaces/msg/SimulatorFeatures")


def test_a_client_spawns_a_body_watches_it_fall_and_deletes_it(robot: Robot) -> None:
    features = robot.call("get_simulator_features").features
    assert {Features.SPAWNING, Features.DELETING, Features.SPAWNING_RESOURCE_STRING} <= set(features.features)
    assert list(features.spawn_formats) == ["urdf"]
    robot.put_into(PAUSED)
    spawned = robot.call("spawn_entity", name="cube", resource_string=CUBE, initial_pose=at(2.0, 1.0, 1.0))
    assert (spawned.result.result, spawned.entity_name) == (Result.RESULT_OK, "cube")
    robot.step(100)
    assert robot.call("get_entity_state", entity="cube").state.pose.position.z == pytest.approx(0.8, abs=5e-3)
    assert robot.call("delete_entity", entity="cube").result.result == Result.RESULT_OK
    assert list(robot.call("get_entities").entities) == ["ball", "talos"]
