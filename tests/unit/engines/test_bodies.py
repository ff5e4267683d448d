"""Bodies of the scene, on every engine that knows contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest
from tests.unit.engines.test_engine_contract import (
    PHYSICS,
    SCENE,
    SEAT,
    START,
    Watcher,
    begin,
    scene_with,
    still,
    swing,
)

from throwcollect.engines.body import HERE, BodyLink, LinkInertia, LinkShape, Placement, moments_of
from throwcollect.engines.engine import BodyState, Engine, Observer, SceneBody, body_of, object_in, split_bodies
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.members import load_member

RADIUS = SCENE.object.radius_m
ROLLING = scene_with(rolling_friction_m=0.002)


def body(kind: str, size: Sequence[float], xyz: Sequence[float], *, rpy=(0.0, 0.0, 0.0), **surface: float) -> SceneBody:
    shape = LinkShape(kind, tuple(size), HERE)
    return SceneBody(BodyLink(f"some_{kind}", shapes=(shape,)), Placement(tuple(xyz), tuple(rpy)), **surface)


BOX = body("box", (0.6, 0.5, 0.1), (1.0, 0.0, 0.75))
CYLINDER = body("cylinder", (0.3, 0.1), (1.0, 0.0, 0.75))
SPHERE = body("sphere", (0.3,), (1.0, 0.0, 0.5))


@pytest.fixture(params=["bullet", "mujoco"])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    pytest.importorskip(ENGINE_PACKAGES[request.param].module)
    made = load_member("engines", request.param)()
    yield made
    made.close()


def drop(engine: Engine, *bodies: SceneBody, scene=SCENE, height_m: float = 1.2, steps: int = 500) -> Watcher:
    """Let the ball fall over the middle of the bodies, at rest at first."""
    engine.load(replace(scene, bodies=bodies))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.place(0, BodyState((1.0, 0.0, height_m)))
    seen = Watcher()
    engine.run(still(engine, steps), seen)
    return seen


@pytest.mark.parametrize("standing", [BOX, CYLINDER, SPHERE], ids=lambda each: each.link.name)
def test_a_ball_that_falls_on_a_body_rests_on_top_of_it(engine: Engine, standing: SceneBody) -> None:
    seen = drop(engine, standing, scene=ROLLING)
    assert object_in(seen.samples[-1][1]).position == pytest.approx((1.0, 0.0, 0.8 + RADIUS), abs=2e-3)
    assert seen.touches[-1][1] == {standing.link.name}


def test_a_ball_slides_down_a_body_that_is_turned(engine: Engine) -> None:
    tilted = replace(BOX, placement=Placement((1.0, 0.0, 0.75), (0.0, 0.5, 0.0)), friction=0.0)
    x, y, z = object_in(drop(engine, tilted, steps=250).samples[-1][1]).position
    # A positive turn about y lowers the side at higher x.
    assert x > 1.05
    assert z < 0.8
    assert y == pytest.approx(0.0, abs=1e-3)


def test_the_restitution_of_a_body_is_multiplied_with_that_of_the_ball(engine: Engine) -> None:
    bouncy = scene_with(restitution=0.8)
    heights = []
    for restitution in (1.0, 0.5, 0.0):
        seen = drop(engine, replace(BOX, restitution=restitution), scene=bouncy, steps=400)
        first = seen.touches[0][0]
        heights.append(max(object_in(sample).position[2] for step, sample in seen.samples if step > first + 5))
    assert heights[0] > heights[1] + 0.05 > heights[2] + 0.1
    assert heights[2] < 0.85


def test_friction_with_a_body_is_the_product_of_both(engine: Engine) -> None:
    def slide(ball: float, surface: float) -> float:
        engine.load(replace(scene_with(friction=ball), bodies=(replace(BOX, friction=surface),)))
        engine.configure(PHYSICS)
        engine.rest(START.tolist(), SEAT)
        engine.place(0, BodyState((0.8, 0.0, 0.8 + RADIUS), linear_velocity=(1.0, 0.0, 0.0)))
        engine.run(still(engine, 100), Observer())
        return object_in(engine.state.sample).linear_velocity[0]

    assert slide(1.0, 0.0) == pytest.approx(1.0, abs=1e-3)
    # A ball that rolls without sliding keeps 5/7 of the speed at which it slid.
    assert slide(0.5, 1.0) == pytest.approx(5 / 7, abs=0.02)
    # 0.2 s of sliding at 0.02 g.
    assert slide(0.2, 0.1) == pytest.approx(1.0 - 0.2 * 0.02 * 9.81, abs=5e-3)


def test_rolling_friction_stops_a_ball_after_the_way_that_it_implies(engine: Engine) -> None:
    lever, speed = 0.002, 0.5
    rolling = scene_with(friction=1.0, rolling_friction_m=lever)
    engine.load(replace(rolling, bodies=(replace(BOX, friction=1.0, link=replace(BOX.link)),)))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    spin = (0.0, speed / RADIUS, 0.0)
    engine.place(0, BodyState((0.75, 0.0, 0.8 + RADIUS), linear_velocity=(speed, 0.0, 0.0), angular_velocity=spin))
    engine.run(still(engine, 750), Observer())
    ball = object_in(engine.state.sample)
    # Rolling takes 7/5 of the energy of sliding, and loses weight times lever over radius on each metre.
    assert ball.position[0] - 0.75 == pytest.approx(0.7 * speed**2 / (9.81 * lever / RADIUS), rel=0.05)
    assert math.hypot(*ball.linear_velocity) < 1e-3


def test_a_changed_body_gives_the_same_bits_as_a_new_world(engine: Engine) -> None:
    others = (
        replace(BOX, placement=Placement((1.1, 0.1, 0.6), (0.2, 0.1, 0.3))),
        body("cylinder", (0.2, 0.3), (1.0, 0.05, 0.5), friction=0.9, restitution=0.4),
        body("sphere", (0.1,), (1.02, 0.0, 0.9)),
    )
    smaller = tuple(
        replace(each, link=replace(each.link, shapes=(replace(shape, size=tuple(0.8 * s for s in shape.size)),)))
        for each in others
        for shape in each.link.shapes
    )
    bouncy = scene_with(restitution=0.5)
    drop(engine, BOX, CYLINDER, SPHERE)
    kept = [drop(engine, *others, scene=bouncy), drop(engine, *smaller), drop(engine, *others, scene=bouncy)]
    fresh = type(engine)()
    assert drop(fresh, *others, scene=bouncy) == kept[0] == kept[2]
    assert kept[0].touches != kept[1].touches
    fresh.close()


def test_throws_do_not_depend_on_bodies_that_nothing_touches(engine: Engine) -> None:
    begin(engine)
    alone, beside = Watcher(), Watcher()
    engine.run(swing(600), alone)
    engine.load(replace(SCENE, bodies=(replace(BOX, placement=Placement((-2.0, 0.0, 0.5))),)))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.run(still(engine, 25), Observer())
    engine.reset(engine.state)
    engine.run(swing(600), beside)
    assert beside == alone


def moving(standing: SceneBody, mass_kg: float, name: str, *, xyz: Sequence[float]) -> SceneBody:
    (shape,) = standing.link.shapes
    x, y, z = moments_of(shape.kind, shape.size, mass_kg)
    link = replace(standing.link, name=name, inertia=LinkInertia(mass_kg, HERE, (x, 0.0, 0.0, y, 0.0, z)))
    return replace(standing, link=link, placement=Placement(tuple(xyz)), restitution=0.0)


CUBE = body("box", (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
LOWER = moving(CUBE, 0.2, "lower", xyz=(1.0, 0.0, 0.9))
UPPER = moving(CUBE, 0.1, "upper", xyz=(1.01, 0.01, 1.1))


def bodies_after(seen: Watcher) -> list[BodyState]:
    return [body_of(numbers) for numbers in split_bodies(seen.samples[-1][1], len(START))]


def test_bodies_that_fall_come_to_rest_on_each_other(engine: Engine) -> None:
    seen = drop(engine, BOX, LOWER, UPPER, height_m=3.0, steps=300)
    lower, upper = bodies_after(seen)
    assert lower.position == pytest.approx((1.0, 0.0, 0.85), abs=3e-3)
    assert upper.position == pytest.approx((1.01, 0.01, 0.95), abs=5e-3)
    assert math.hypot(*upper.linear_velocity) < 0.01
    assert seen.touches == []


def test_a_body_rests_on_the_ground_even_if_that_does_not_stop_the_ball(engine: Engine) -> None:
    engine.load(replace(SCENE, bodies=(LOWER,), ground_is_solid=False))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.place(0, BodyState((2.0, 0.0, 1.0)))
    seen = Watcher()
    engine.run(still(engine, 500), seen)
    assert bodies_after(seen)[0].position[2] == pytest.approx(0.05, abs=3e-3)
    assert object_in(seen.samples[-1][1]).position[2] < -1.0


def test_a_ball_pushes_a_body_that_it_hits_and_keeps_the_momentum(engine: Engine) -> None:
    light = replace(moving(CUBE, 0.05, "light", xyz=(1.0, 0.0, 0.85)), friction=0.0)
    engine.load(replace(scene_with(mass_kg=0.05), bodies=(replace(BOX, friction=0.0), light)))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.place(0, BodyState((0.8, 0.0, 0.86), linear_velocity=(2.0, 0.0, 0.0)))
    seen = Watcher()
    engine.run(still(engine, 75), seen)
    (hit,), ball = bodies_after(seen), object_in(seen.samples[-1][1])
    assert "light" in {name for _, names in seen.touches for name in names}
    assert hit.linear_velocity[0] > 0.8
    assert hit.linear_velocity[0] + ball.linear_velocity[0] == pytest.approx(2.0, abs=0.05)


def test_the_robot_pushes_a_body(engine: Engine) -> None:
    engine.load(SCENE)
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    x, y, z = object_in(engine.state.sample).position
    # In the way of the spoon, whose swing goes forwards.
    engine.load(replace(SCENE, bodies=(moving(CUBE, 0.1, "box", xyz=(x + 0.25, y, z + 0.2)),)))
    engine.configure(replace(PHYSICS, gravity_mps2=0.01))
    engine.rest(START.tolist(), SEAT)
    seen = Watcher()
    engine.run(swing(500), seen)
    assert math.hypot(*bodies_after(seen)[0].linear_velocity) > 0.2


def test_a_state_with_bodies_is_restored_with_all_its_bits(engine: Engine) -> None:
    before = drop(engine, BOX, LOWER, UPPER, height_m=1.4, steps=120)
    state = engine.state
    once, again = Watcher(), Watcher()
    engine.reset(state)
    engine.run(still(engine, 300), once)
    engine.reset(state)
    engine.run(still(engine, 300), again)
    assert once == again
    fresh = type(engine)()
    assert drop(fresh, BOX, LOWER, UPPER, height_m=1.4, steps=120) == before
    fresh.reset(state)
    other = Watcher()
    fresh.run(still(fresh, 300), other)
    assert other == once
    fresh.close()
