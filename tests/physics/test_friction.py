"""Friction of both engines is Coulomb's: it brakes what slides, equally in all directions, and does not turn it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.engines.test_engine_contract import PHYSICS, SCENE, begin, still

from throwcollect.engines.engine import BodyState, Engine, Observer, ball_of
from throwcollect.members import load_member
from throwcollect.sim.spawnable import read_model

SPEED_MPS = 2.0
PUCK = """<robot name="puck"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.0025" iyy="0.0025" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><cylinder radius="0.1" length="0.02"/></geometry></collision>
</link></robot>"""


@pytest.fixture(params=["bullet", "mujoco"])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    made = load_member("engines", request.param)()
    begin(made)
    yield made
    made.close()


def velocity(angle: float) -> tuple[float, float, float]:
    return SPEED_MPS * float(np.cos(angle)), SPEED_MPS * float(np.sin(angle)), 0.0


@pytest.mark.parametrize("degrees", [0.0, 11.25, 22.5, 45.0, 70.0])
def test_a_sliding_ball_keeps_its_direction_and_slows_by_the_product_of_frictions(
    engine: Engine, degrees: float
) -> None:
    angle = np.radians(degrees)
    engine.place_ball(BodyState((2.0, 0.0, SCENE.ball_radius_m), linear_velocity=velocity(angle)))
    engine.run(still(engine, 50), Observer())
    x, y, _ = ball_of(engine.state.sample).linear_velocity
    friction = PHYSICS.ball_friction * PHYSICS.surface_friction
    assert np.arctan2(y, x) == pytest.approx(angle, abs=1e-3)
    assert SPEED_MPS - np.hypot(x, y) == pytest.approx(friction * PHYSICS.gravity_mps2 * 50 / PHYSICS.hz, rel=0.01)


# Bullet solves the contacts at the rim of a puck one after the other, which turns the puck a little.
@pytest.mark.parametrize("degrees", [0.0, 22.5, 45.0])
def test_a_puck_slides_in_its_direction_until_friction_has_stopped_it(engine: Engine, degrees: float) -> None:
    assert engine.bodies is not None
    angle, friction = np.radians(degrees), 0.5
    engine.configure(replace(PHYSICS, surface_friction=friction))
    puck = read_model(PUCK, lambda _: pytest.fail("there is no mesh"))
    start = BodyState((3.0, 0.0, 0.01), linear_velocity=velocity(angle))
    engine.bodies.add("puck", puck, start)
    engine.bodies.place("puck", start)
    engine.run(still(engine, 700), Observer())
    there = engine.bodies.state("puck")
    x, y = there.position[0] - 3.0, there.position[1]
    assert there.linear_velocity == pytest.approx((0, 0, 0), abs=1e-3)
    assert np.arctan2(y, x) == pytest.approx(angle, abs=np.radians(2))
    assert np.hypot(x, y) == pytest.approx(SPEED_MPS**2 / (2 * friction**2 * PHYSICS.gravity_mps2), rel=0.06)
