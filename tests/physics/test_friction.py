"""Friction of both engines is Coulomb's: it brakes what slides, equally in all directions, and does not turn it."""

from collections.abc import Iterator

import numpy as np
import pytest
from tests.unit.engines.test_engine_contract import PHYSICS, SCENE, begin, still

from throwcollect.engines.engine import BodyState, Engine, Observer, object_in
from throwcollect.members import load_member

SPEED_MPS = 2.0


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
    engine.place(0, BodyState((2.0, 0.0, SCENE.object.radius_m), linear_velocity=velocity(angle)))
    engine.run(still(engine, 50), Observer())
    x, y, _ = object_in(engine.state.sample).linear_velocity
    friction = SCENE.object.friction * PHYSICS.surface_friction
    assert np.arctan2(y, x) == pytest.approx(angle, abs=1e-3)
    assert SPEED_MPS - np.hypot(x, y) == pytest.approx(friction * PHYSICS.gravity_mps2 * 50 / PHYSICS.hz, rel=0.01)
