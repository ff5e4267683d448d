"""The object that the robot acts on: which body it is, where it starts, and that it is recorded under its name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect import Simulator
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.robots.surroundings import object_of

TABLE = {"shape": "box", "size_m": [0.8, 1.2, 0.1], "position_m": [1.2, -0.3, 0.8]}
CUBE = {"shape": "box", "size_m": [0.05, 0.04, 0.03], "mass_kg": 0.05, "lies_on": "claw"}
PUCK = {"shape": "cylinder", "radius_m": 0.04, "length_m": 0.03, "mass_kg": 0.15, "lies_on": "table"}


def configure(acted_on: str | None, **bodies: Any) -> dict[str, Any]:
    return {"object": acted_on, "scene": {"bodies": bodies}}


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_the_claw_throws_a_box_as_far_as_a_ball(engine: str) -> None:
    base = {"tool": {"name": "claw"}, "sim": {"engine": engine}}
    ball = Simulator(Config.model_validate({**base, "ball": {"mass_kg": 0.05, "radius_m": 0.035}})).throw({})
    cube = Simulator(Config.model_validate({**base, **configure("cube", cube=CUBE)})).throw({})
    assert (ball.outcome, cube.outcome) == ("landed", "landed")
    assert cube.events.release is not None
    assert ball.events.release is not None
    assert cube.events.release.position == pytest.approx(ball.events.release.position, abs=2e-3)
    assert cube["landing_x_m"] == pytest.approx(ball["landing_x_m"], abs=0.02)
    assert cube.object.name == "cube"
    assert list(cube.bodies) == ["cube"]
    # It is turned with the claw until it is let go.
    assert abs(cube.object.orientation_xyzw[-1, 3]) < 0.999
    assert "cube_x_m" in cube.to_pandas().columns


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_a_puck_starts_on_the_table_with_its_velocity(engine: str) -> None:
    moving = {**PUCK, "position_m": [0.1, 0.2, 0.0], "velocity_mps": [0.5, 0.1, 0.0]}
    settings = {"sim": {"engine": engine}, **configure("puck", table=TABLE, puck=moving)}
    throw = Simulator(Config.model_validate(settings)).throw({})
    puck = throw.object
    assert puck.position[0] == pytest.approx((1.3, -0.1, 0.85 + 0.015), abs=1e-12)
    assert puck.velocity[0] == pytest.approx((0.5, 0.1, 0.0), abs=1e-12)
    assert {contact.body for contact in throw.events.contacts} == {"table"}
    assert puck.position[-1][0] > 1.31
    assert np.linalg.norm(puck.velocity[-1]) < 0.01


@pytest.mark.parametrize(
    ("body", "height_m"),
    [
        (PUCK, 0.865),
        ({**PUCK, "rpy_rad": [np.pi / 2, 0.0, 0.3]}, 0.89),
        ({**PUCK, "shape": "sphere", "length_m": None, "position_m": [0.0, 0.0, 0.5]}, 1.39),
        (
            {
                "shape": "box",
                "size_m": [0.2, 0.1, 0.1],
                "mass_kg": 1.0,
                "lies_on": "table",
                "rpy_rad": [0, np.pi / 2, 0],
            },
            0.95,
        ),
    ],
)
def test_what_lies_on_a_body_touches_its_upper_side(body: dict[str, Any], height_m: float) -> None:
    kept = {key: value for key, value in body.items() if value is not None}
    placed = object_of(Config.model_validate(configure("thing", table=TABLE, thing=kept))).placement
    assert placed.xyz == pytest.approx((1.2, -0.3, height_m), abs=1e-9)


@pytest.mark.parametrize(
    ("settings", "key", "required"),
    [
        (
            configure("cup", puck=PUCK, table=TABLE),
            "object",
            "should be a box, cylinder or sphere with a mass_kg, puck, got cup",
        ),
        ({**configure("puck", puck=PUCK, table=TABLE), "ball": {"mass_kg": 0.1}}, "ball", "acts on puck"),
        (configure(None, cube=CUBE), "scene.bodies.cube.lies_on", "got claw"),
    ],
)
def test_a_wrong_object_is_refused_with_its_key(
    settings: dict[str, Any], key: str, required: str, tmp_path: Path
) -> None:
    (tmp_path / "wrong.yaml").write_text(json.dumps(settings), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        load(tmp_path / "wrong.yaml")
    (problem,) = raised.value.problems
    assert problem.key == key
    assert required in problem.message
