"""Bodies that overlap at the start, as the plan finds them."""

from __future__ import annotations

from functools import cache

import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.feasibility import Feasibility
from throwcollect.sim.world import World
from throwcollect.tasks.task import trajectory_of

TABLE = {"shape": "box", "size_m": [0.4, 0.4, 0.1], "position_m": [1.5, 0.0, 0.5]}
CAN = {"shape": "cylinder", "radius_m": 0.04, "length_m": 0.1, "mass_kg": 0.1, "lies_on": "table"}


def check(objects: str | None = None, **bodies: object) -> str | None:
    config = Config.model_validate({"object": objects, "scene": {"bodies": {"table": TABLE, **bodies}}})
    return make_feasibility().check(config, trajectory_of(config))


@cache
def make_feasibility() -> Feasibility:
    return Feasibility(Config())


def test_bodies_may_lie_on_each_other_and_those_that_never_move_may_overlap() -> None:
    wall = {**TABLE, "position_m": [1.75, 0.0, 0.6]}
    assert check(wall=wall, can=CAN, other={**CAN, "position_m": [-0.1, 0.0, 0.0]}) is None


@pytest.mark.parametrize(
    ("acted_on", "bodies", "message"),
    [
        (None, {"can": {**CAN, "position_m": [0.0, 0.0, -0.02]}}, "table and can overlap by 20 mm at the start"),
        ("can", {"can": {**CAN, "position_m": [0.0, 0.0, -0.02]}}, "can and table overlap by 20 mm at the start"),
        (None, {"can": CAN, "other": {**CAN, "position_m": [0.03, 0.0, 0.0]}}, "can and other overlap by 50 mm"),
        (
            "can",
            {"can": {**CAN, "lies_on": None, "position_m": [0.0, 0.0, 0.9]}},
            "base_link and can overlap at the start",
        ),
    ],
)
def test_overlapping_bodies_are_refused(acted_on: str | None, bodies: dict[str, object], message: str) -> None:
    assert message in (check(acted_on, **bodies) or "")


def test_the_ball_that_lies_in_the_tool_overlaps_what_reaches_into_it() -> None:
    world = World(Config())
    x, y, z = world.bodies["ball"].position
    world.close()
    pearl = {"shape": "sphere", "radius_m": 0.005, "mass_kg": 0.1}
    assert "ball and pearl overlap by 4" in (check(pearl={**pearl, "position_m": [x, y, z + 0.0255]}) or "")
