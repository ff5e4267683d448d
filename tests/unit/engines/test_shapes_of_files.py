"""Meshes, and bodies of several shapes whose frame is not that of their centre of mass, on every engine."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.engines.test_bodies import BOX, LOWER, RADIUS, bodies_after, drop, moving
from tests.unit.engines.test_engine_contract import PHYSICS, SCENE, SEAT, START, Watcher, still

from throwcollect.engines.body import HERE, BodyLink, LinkInertia, LinkShape, Placement
from throwcollect.engines.engine import BodyState, Engine, SceneBody, object_in
from throwcollect.engines.mesh import Mesh, encode
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.members import load_member


@pytest.fixture(params=["bullet", "mujoco"])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    pytest.importorskip(ENGINE_PACKAGES[request.param].module)
    made = load_member("engines", request.param)()
    yield made
    made.close()


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    """A cube with edges of 1 around the origin, as a mesh that is its own hull."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)), np.float32)
    path = tmp_path_factory.mktemp("meshes") / "cube.stl"
    path.write_bytes(encode(corners[[(0, 1, 2), (5, 6, 7), (3, 4, 5)]]))
    return Mesh(path)


def as_mesh(body: SceneBody, cube: Mesh) -> SceneBody:
    """Replace a box by a mesh of the same size."""
    (shape,) = body.link.shapes
    return replace(body, link=replace(body.link, shapes=(LinkShape("mesh", shape.size, HERE, cube),)))


def test_a_mesh_of_a_box_stands_and_stops_a_ball_as_the_box_does(engine: Engine, cube: Mesh) -> None:
    upper = moving(BOX, 0.2, "upper", xyz=(1.2, 0.0, 0.87))
    small = replace(upper, link=replace(upper.link, shapes=(LinkShape("box", (0.1, 0.1, 0.1), HERE),)))
    for bodies in ((BOX, small), (as_mesh(BOX, cube), as_mesh(small, cube))):
        seen = drop(engine, *bodies, height_m=1.0, steps=500)
        (stands,) = bodies_after(seen)
        assert stands.position == pytest.approx((1.2, 0.0, 0.85), abs=5e-4)
        assert stands.orientation_xyzw == pytest.approx((0, 0, 0, 1), abs=3e-3)
        assert object_in(seen.samples[-1][1]).position[2] == pytest.approx(0.8 + RADIUS, abs=1e-3)
        assert seen.touches[-1][1] == {"some_box"}


def fly(engine: Engine, body: SceneBody, state: BodyState, steps: int) -> BodyState:
    """Let a body move without gravity for some steps; the ball is far away."""
    engine.load(replace(SCENE, bodies=(body,)))
    engine.configure(replace(PHYSICS, gravity_mps2=1e-9))
    engine.rest(START.tolist(), SEAT)
    engine.place(1, state)
    seen = Watcher()
    engine.run(still(engine, steps), seen)
    return bodies_after(seen)[0]


def hammer(cube: Mesh) -> SceneBody:
    """A handle and a head, whose frame is the end of the handle, and whose inertia has no axis of it."""
    shapes = (
        LinkShape("cylinder", (0.02, 0.4), Placement((0.0, 0.0, 0.2))),
        LinkShape("mesh", (0.1, 0.1, 0.1), Placement((0.0, 0.0, 0.4), (0.0, 0.0, 0.3)), cube),
    )
    inertia = LinkInertia(0.5, Placement((0.02, 0.0, 0.35)), (2e-3, 1e-4, 2e-4, 2.2e-3, 1e-4, 7e-4))
    return SceneBody(BodyLink("hammer", inertia, shapes), Placement((5.0, 0.0, 1.0)), restitution=0.0)


def test_a_body_turns_about_its_centre_of_mass_and_is_placed_by_its_origin(engine: Engine, cube: Mesh) -> None:
    turning = BodyState((5.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    engine.load(replace(SCENE, bodies=(hammer(cube),)))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.place(1, turning)
    assert [*engine.state.sample[-26:-13]] == pytest.approx(
        [*turning.position, *turning.orientation_xyzw, *turning.linear_velocity, *turning.angular_velocity], abs=1e-7
    )
    after = fly(engine, hammer(cube), turning, 100)
    # The centre of mass goes straight on: at 3 rad/s, 0.02 m beside the origin.
    x, y, z, w = after.orientation_xyzw
    arm = np.array([0.02, 0.0, 0.35])
    turned = arm + 2 * np.cross([x, y, z], np.cross([x, y, z], arm) + w * arm)
    assert np.array(after.position) + turned == pytest.approx([5.02, 0.06 * 0.2, 1.35], abs=2e-3)
    assert after.angular_velocity[2] == pytest.approx(3.0, abs=0.2)


def test_engines_agree_on_a_body_of_several_shapes(cube: Mesh) -> None:
    states = []
    for name in ("bullet", "mujoco"):
        pytest.importorskip(ENGINE_PACKAGES[name].module)
        engine = load_member("engines", name)()
        spinning = BodyState((5.0, 0.0, 1.0), (0.5, 0.5, 0.5, 0.5), (0.1, 0.2, 0.3), (3.0, 2.0, 1.0))
        states.append(fly(engine, hammer(cube), spinning, 100))
        engine.close()
    one, other = states
    assert one.position == pytest.approx(other.position, abs=3e-3)
    assert one.orientation_xyzw == pytest.approx(other.orientation_xyzw, abs=5e-3)
    assert one.angular_velocity == pytest.approx(other.angular_velocity, abs=0.03)


def rest_of(engine: Engine, *bodies: SceneBody) -> Sequence[float]:
    seen = drop(engine, *bodies, height_m=20.0, steps=900)
    return bodies_after(seen)[0].position


def test_a_hammer_lies_on_a_box_by_its_head(engine: Engine, cube: Mesh) -> None:
    lying = replace(hammer(cube), placement=Placement((0.8, 0.0, 0.88), (0.0, np.pi / 2, 0.0)))
    x, y, z = rest_of(engine, replace(BOX, placement=Placement((1.0, 0.0, 0.75))), lying)
    assert (y, z) == (pytest.approx(0.0, abs=0.05), pytest.approx(0.82, abs=0.005))
    assert x == pytest.approx(0.8, abs=0.1)


def test_a_changed_body_of_a_file_gives_the_same_bits_as_a_new_world(engine: Engine, cube: Mesh) -> None:
    first = replace(hammer(cube), placement=Placement((1.0, 0.0, 0.9)))
    (handle, head), inertia = first.link.shapes, first.inertia
    heavy = replace(first, link=replace(first.link, inertia=replace(inertia, mass_kg=1.0)))
    larger = replace(first, link=replace(first.link, shapes=(handle, replace(head, size=(0.3, 0.2, 0.1)))))
    kept = [drop(engine, BOX, each, steps=200) for each in (first, heavy, larger, first)]
    assert kept[0] == kept[3]
    assert kept[0] != kept[1] != kept[2]
    fresh = type(engine)()
    assert drop(fresh, BOX, larger, steps=200) == kept[2]
    assert drop(fresh, as_mesh(BOX, cube), as_mesh(LOWER, cube), steps=200) == drop(
        engine, as_mesh(BOX, cube), as_mesh(LOWER, cube), steps=200
    )
    fresh.close()
