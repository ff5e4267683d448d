"""Motions of the robot beside bodies of the scene, as the plan checks them."""

from __future__ import annotations

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.robots.feasibility import Feasibility
from throwcollect.tasks.task import trajectory_of


def scene(name: str = "table", **body: object) -> Config:
    section = {"shape": "box", "size_m": [0.4, 1.0, 0.05], "position_m": [1.2, -0.2, 1.0], **body}
    return Config.model_validate({"scene": {"bodies": {name: section}}})


def refusal(feasibility: Feasibility, config: Config) -> str | None:
    return feasibility.check(config, trajectory_of(config))


def test_a_motion_through_a_body_is_refused_and_one_beside_it_is_not() -> None:
    config = scene()
    feasibility = Feasibility(config)
    assert refusal(feasibility, config) is None
    near = with_values(config, {"scene.bodies.table.position_m.0": 0.3, "scene.bodies.table.position_m.2": 2.3})
    assert "spoon and table overlap at 0." in (refusal(feasibility, near) or "")
    # The object that checks trials remembers nothing of earlier scenes.
    assert refusal(feasibility, config) is None
    assert refusal(feasibility, Config()) is None


def test_the_base_of_the_robot_has_its_height() -> None:
    # At the height of the feet.
    config = scene(size_m=[0.05, 0.4, 0.05], position_m=[0.05, 0.0, 0.05])
    assert "leg" in (refusal(Feasibility(config), config) or "")
    lifted = with_values(config, {"robot.base_height_m": 1.5})
    assert refusal(Feasibility(lifted), lifted) is None
