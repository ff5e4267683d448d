"""Services about entities: their names and states."""

from pathlib import Path
from typing import Any

import pytest

from tests.integration.robot import CONFIG, OWN, PAUSED, Result, Robot, running_simulation
from throwcollect.config.schema import Config
from throwcollect.ros import Context, get_message, get_service

SetEntityState: Any = get_service("simulation_interfaces/srv/SetEntityState")
EntityState: Any = get_message("simulation_interfaces/msg/EntityState")


def entity_state(*, z: float = 1.0, vx: float = 0.0, w: float = 1.0, frame: str = "world") -> Any:
    state = EntityState()
    state.header.frame_id = frame
    state.pose.position.x, state.pose.position.z = 2.0, z
    state.pose.orientation.w = w
    state.twist.linear.x = vx
    return state


def test_the_ball_lies_in_the_spoon_and_the_robot_stands_on_its_base(robot: Robot) -> None:
    ball = robot.call("get_entity_state", entity="ball").state
    assert ball.header.frame_id == "world"
    assert 0.5 < ball.pose.position.z < 2.0
    talos = robot.call("get_entity_state", entity="talos").state
    assert talos.pose.position.z == 1.01927
    assert talos.pose.orientation.w == 1.0


def test_a_placed_ball_flies_on_from_its_new_position(robot: Robot) -> None:
    robot.put_into(PAUSED)
    placed = robot.call("set_entity_state", entity="ball", state=entity_state(z=1.5, vx=1.0))
    assert placed.result.result == Result.RESULT_OK
    there = robot.call("get_entity_state", entity="ball").state
    assert (there.pose.position.x, there.pose.position.z, there.twist.linear.x) == (2.0, 1.5, 1.0)
    robot.step(100)
    flown = robot.call("get_entity_state", entity="ball").state
    assert flown.pose.position.x == pytest.approx(2.2, abs=1e-3)
    assert flown.pose.position.z == pytest.approx(1.5 - 9.81 * 0.2**2 / 2, abs=5e-3)
    assert flown.twist.linear.z == pytest.approx(-9.81 * 0.2, abs=1e-2)


@pytest.mark.parametrize(
    ("state", "code", "words"),
    [
        (entity_state(w=0.0), SetEntityState.Response.INVALID_POSE, "quaternion of norm 0"),
        (entity_state(z=1e9), SetEntityState.Response.INVALID_POSE, "at most 1000 m"),
    ],
)
def test_a_state_without_meaning_is_refused_and_leaves_the_ball(
    state: Any, code: int, words: str, robot: Robot
) -> None:
    before = robot.call("get_entity_state", entity="ball").state
    refused = robot.call("set_entity_state", entity="ball", state=state).result
    assert refused.result == code
    assert words in refused.error_message
    assert robot.call("get_entity_state", entity="ball").state == before


def test_get_entities_states_returns_the_state_of_each_entity(robot: Robot) -> None:
    response = robot.call("get_entities_states")
    assert list(response.entities) == list(robot.call("get_entities").entities) == ["ball", "talos"]
    for name, state in zip(response.entities, response.states, strict=True):
        assert robot.call("get_entity_state", entity=name).state == state


def test_bodies_of_the_scene_and_of_the_task_are_entities_and_those_with_a_mass_can_be_moved(
    endpoint: str, session: Context, tmp_path: Path
) -> None:
    pole = {"shape": "cylinder", "position_m": [1.0, 2.0, 0.5], "rpy_rad": [0, 0, 1], "radius_m": 0.1, "length_m": 1.0}
    can = {"shape": "box", "position_m": [1.0, 1.0, 0.05], "size_m": [0.1, 0.1, 0.1], "mass_kg": 0.2}
    scene = {"scene": {"bodies": {"pole": pole, "can": can}}, "task": {"name": "throw_into", "wall": {"height_m": 0.8}}}
    config = Config.model_validate({**CONFIG.model_dump(exclude_defaults=True), **scene})
    with running_simulation(tmp_path, endpoint, session, OWN, config) as robot:
        bin_parts = [f"bin_{part}" for part in ("floor", "front", "back", "right", "left")]
        response = robot.call("get_entities_states")
        assert list(response.entities) == ["ball", "can", "pole", *bin_parts, "wall", "talos"]
        pose = robot.call("get_entity_state", entity="pole").state.pose
        assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, 2.0, 0.5)
        assert (pose.orientation.z, pose.orientation.w) == pytest.approx((0.479426, 0.877583), abs=1e-6)
        assert robot.call("get_entity_state", entity="wall").state.pose.position.z == 0.4
        for name in ("pole", "wall"):
            refused = robot.call("set_entity_state", entity=name, state=entity_state()).result
            assert refused.result == Result.RESULT_OPERATION_FAILED
            assert refused.error_message == f"{name} is fixed to the world"
        assert robot.call("get_entity_state", entity="pole").state.pose == pose
        assert robot.call("set_entity_state", entity="can", state=entity_state()).result.result == Result.RESULT_OK
        assert robot.call("get_entity_state", entity="can").state.pose == entity_state().pose
        assert robot.call("get_entity_state", entity="ball").state.pose != entity_state().pose
