"""A ball that the tool holds until it lets go, on every engine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.engines.test_engine_contract import PHYSICS, START, STRIDE, Watcher, scene_with, still, swing

from throwcollect.config.schema import Config
from throwcollect.engines.body import Vector
from throwcollect.engines.engine import BodyState, Engine, Observer, Sample, State, Steps, object_in
from throwcollect.engines.grip import carry
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.members import load_member, names_of
from throwcollect.robots.description import physics_description, robot_of
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.sim.scene import scene_of

CONFIG = Config.model_validate({"tool": {"name": "claw"}, "scene": {"landing_height_m": 0.5}})
DESCRIPTION = physics_description(CONFIG)
SCENE = scene_of(CONFIG, DESCRIPTION)
MOVING = len(SCENE.moving)
HELD = 350
"""Number of the last step in which the ball is held."""


def begin(engine: Engine, *, scene=SCENE) -> State:
    engine.load(scene)
    engine.configure(PHYSICS)
    assert SCENE.tool.seat is not None
    engine.rest(START.tolist(), SCENE.tool.seat)
    engine.run(replace(still(engine, 25), held=25), Observer())
    settled = engine.state
    engine.reset(settled)
    return settled


def swing_and_let_go(steps: int = 600, *, first: int = 0, held: int = HELD) -> Steps:
    return replace(swing(steps, first=first), held=max(0, held - first))


def watch_throw(engine: Engine) -> Watcher:
    seen = Watcher()
    engine.run(swing_and_let_go(), seen)
    return seen


def find_seat(sample: Sample) -> Vector:
    """Compute the place of a held ball from the joints of a sample."""
    angles = {**DESCRIPTION.locked, **dict(zip(SCENE.moving, sample[:MOVING], strict=True))}
    place = ToolMotion(CONFIG).place(np.array([angles[joint] for joint in robot_of(CONFIG).joints]))
    return tuple(place.tolist())


@pytest.fixture(params=names_of("engines"))
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    if request.param in ENGINE_PACKAGES:
        pytest.importorskip(ENGINE_PACKAGES[request.param].module)
    made = load_member("engines", request.param)()
    begin(made)
    yield made
    made.close()


def test_a_held_ball_moves_with_the_tool_and_is_free_after_the_last_step_in_which_it_is_held(engine: Engine) -> None:
    assert engine.state.touching == {"claw"}
    seen = watch_throw(engine)
    assert seen.touches == [(HELD + 1, frozenset())]
    balls = {step: object_in(sample) for step, sample in seen.samples}
    for step, sample in seen.samples:
        if step <= HELD:
            assert balls[step].position == pytest.approx(find_seat(sample), abs=1e-6)
        else:
            dt = STRIDE / PHYSICS.hz
            gravity = PHYSICS.gravity_mps2
            x, y, z = balls[step - STRIDE].linear_velocity
            assert balls[step].linear_velocity == pytest.approx((x, y, z - gravity * dt), abs=1e-12)
    # The velocity is that which leads from each place to the next, before and after the release.
    path = np.array([ball.position for ball in balls.values()])
    velocities = np.array([ball.linear_velocity for ball in balls.values()])
    assert np.diff(path, axis=0) * PHYSICS.hz / STRIDE == pytest.approx(velocities[1:], abs=0.03)
    assert np.linalg.norm(velocities, axis=1).max() > 1.5


def test_a_throw_has_the_same_bits_whatever_ran_before(engine: Engine) -> None:
    settled = begin(engine)
    first = watch_throw(engine)
    engine.reset(settled)
    assert watch_throw(engine) == first
    # A trial that ends while the ball is held, and one in which it is taken out of the tool.
    engine.run(swing_and_let_go(100), Observer())
    engine.reset(settled)
    assert watch_throw(engine) == first
    engine.reset(settled)
    engine.place(0, BodyState((1.0, 0.0, 2.0)))
    engine.run(swing_and_let_go(100), Observer())
    begin(engine, scene=scene_with(SCENE, mass_kg=0.2))
    watch_throw(engine)
    begin(engine)
    assert watch_throw(engine) == first


def test_single_steps_give_the_same_throw_as_many_at_once(engine: Engine) -> None:
    at_once, one_by_one = watch_throw(engine), Watcher()
    begin(engine)
    for number in range(600):
        one_by_one.offset = number
        engine.run(swing_and_let_go(1, first=number), one_by_one)
    assert one_by_one == replace(at_once, offset=599)


def test_a_ball_that_is_placed_elsewhere_is_not_held_any_more(engine: Engine) -> None:
    engine.place(0, BodyState((1.0, 0.0, 2.0)))
    seen = Watcher()
    engine.run(replace(still(engine, 50), held=50), seen)
    x, y, z = object_in(engine.state.sample).position
    assert (x, y) == (1.0, 0.0)
    assert z == pytest.approx(2.0 - PHYSICS.gravity_mps2 * (50 / PHYSICS.hz) ** 2 / 2, rel=0.01)
    assert seen.touches == [(1, frozenset())]


@pytest.mark.parametrize("name", ["bullet", "mujoco"])
def test_the_arm_bears_the_ball_until_the_release_alone(name: str) -> None:
    pytest.importorskip(ENGINE_PACKAGES[name].module)
    made: Engine = load_member("engines", name)()
    efforts = {}
    for mass_kg in (0.02, 0.12):
        begin(made, scene=scene_with(SCENE, mass_kg=mass_kg))
        seen = Watcher()
        made.run(replace(still(made, 200), held=100), seen)
        efforts[mass_kg] = np.array([sample[2 * MOVING : 3 * MOVING] for _, sample in seen.samples])
    made.close()
    elbow = SCENE.moving.index("arm_right_4_joint")
    held, free = (efforts[0.12] - efforts[0.02])[[50, 110], elbow]
    # The ball is about half a metre from the elbow, and falls onto the palm after the second row.
    assert 0.35 < held / (0.1 * PHYSICS.gravity_mps2) < 0.65
    assert abs(free) < 1e-3


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_held_ball_spins_as_the_tool_turns(sign: float) -> None:
    half = 0.003
    turned = (0.0, sign * np.sin(half), 0.0, sign * np.cos(half))
    ball = carry(BodyState((0.0, 0.0, 0.0)), (0.01, 0.0, 0.0), turned, 500.0)
    assert ball.angular_velocity == pytest.approx((0.0, 2 * half * 500, 0.0), rel=1e-9)
    assert ball.linear_velocity == pytest.approx((5.0, 0.0, 0.0))
