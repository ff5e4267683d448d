from collections.abc import Iterator

import numpy as np
import pytest
from tests.unit.sim.bodies import box, pendulum

from throwcollect.config.schema import Config
from throwcollect.engines.engine import BodyState
from throwcollect.errors import ConfigError, RequestError
from throwcollect.robots.description import start_posture
from throwcollect.ros.msg import Bounds, EntityFilters, Vector3
from throwcollect.sim.entities import Category, Entities, EntityInfo
from throwcollect.sim.entity_filter import select
from throwcollect.sim.spawnable import read_model
from throwcollect.sim.world import World

CONFIG = Config()
TURNED = (0.0, 0.0, 0.6, 0.8)
LOPSIDED = '<inertia ixx="1" iyy="2" izz="2.5" ixy="0.3" ixz="0" iyz="0.1"/>'
"""Inertia of a body whose axes, by which the engine locates it, are not those of the link."""


def within(kind: int, *points: tuple[float, float, float]) -> EntityFilters:
    return EntityFilters(bounds=Bounds(type=kind, points=[Vector3(x=x, y=y, z=z) for x, y, z in points]))


def sphere(centre: tuple[float, float, float], radius: float) -> EntityFilters:
    return within(Bounds.TYPE_SPHERE, centre, (radius, 0.0, 0.0))


def model(text):
    return read_model(text, no_mesh)


def no_mesh(filename):
    raise AssertionError(filename)


@pytest.fixture(scope="module", params=["bullet", "mujoco"])
def shared(request: pytest.FixtureRequest) -> Iterator[World]:
    # A world keeps the engine with which it was made.
    world = World(Config.model_validate({"sim": {"engine": request.param}}))
    yield world
    world.close()


@pytest.fixture
def world(shared: World) -> World:
    shared.spawned.clear()
    shared.reset(CONFIG)
    return shared


@pytest.fixture
def entities(world: World) -> Entities:
    return Entities(world, "talos")


def run(world: World, steps: int) -> None:
    world.run(np.tile([start_posture(CONFIG)[joint] for joint in world.moving], (steps, 1)), stop_at_end=False)


def assert_same(state: BodyState, other: BodyState) -> None:
    for name in ("position", "orientation_xyzw", "linear_velocity", "angular_velocity"):
        assert getattr(state, name) == pytest.approx(getattr(other, name), abs=2e-6), name


def test_the_ball_can_be_placed_and_the_robot_cannot(entities: Entities) -> None:
    entities.place("ball", BodyState((1.0, 0.0, 1.0)), frame="", accelerates=False)
    assert entities.state("ball").position == (1.0, 0.0, 1.0)
    with pytest.raises(RequestError, match="talos is fixed to the world"):
        entities.place("talos", BodyState((0.0, 0.0, 1.0)), frame="", accelerates=False)
    assert entities.state("talos").position == (0.0, 0.0, CONFIG.robot.base_height_m)
    with pytest.raises(RequestError, match="no entity 'table'; known: ball, talos"):
        entities.state("table")


def test_the_pose_of_a_body_is_that_of_its_root_link_not_of_its_mass(entities: Entities) -> None:
    start = BodyState((1.0, 2.0, 3.0), TURNED)
    entities.add("crate", model(box(origin="0.1 0.2 -0.05", inertia=LOPSIDED)), start, "")
    assert_same(entities.state("crate"), start)
    moving = BodyState((2.0, 1.0, 3.0), (0.0, 0.6, 0.0, 0.8), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    entities.place("crate", moving, frame="world", accelerates=False)
    assert_same(entities.state("crate"), moving)


def test_a_turning_body_flies_about_its_centre_of_mass(world: World, entities: Entities) -> None:
    entities.add("crate", model(box(origin="0.5 0 0")), BodyState((5.0, 0.0, 5.0)), "")
    spin = BodyState((5.0, 0.0, 5.0), linear_velocity=(0.0, -0.5, 0.0), angular_velocity=(0.0, 0.0, 1.0))
    entities.place("crate", spin, frame="", accelerates=False)
    run(world, 500)
    # The centre of mass, half a metre ahead, had no speed: the link goes round it by one radian.
    x, y, _ = entities.state("crate").position
    assert (x, y) == pytest.approx((5.5 - 0.5 * np.cos(1), -0.5 * np.sin(1)), abs=2e-3)


def test_bounds_are_along_the_axes_of_the_root_link_and_follow_its_joints(world: World, entities: Entities) -> None:
    turned = BodyState((5.0, 0.0, 5.0), TURNED)
    entities.add("crate", model(box("0.2 0.4 0.6", origin="0.1 0 0", inertia=LOPSIDED)), turned, "")
    lowest, highest = entities.bounds("crate")
    assert lowest == pytest.approx((0.0, -0.2, -0.3), abs=1e-6)
    assert highest == pytest.approx((0.2, 0.2, 0.3), abs=1e-6)
    entities.add("pendulum", model(pendulum()), BodyState((3.0, 0.0, 2.0)), "")
    _, highest = entities.bounds("pendulum")
    assert highest == pytest.approx((1.0, 0.05, 0.05), abs=0.01)
    run(world, 400)
    lowest, highest = entities.bounds("pendulum")
    assert lowest[2] < -0.5
    assert highest[0] < 0.95
    assert entities.state("pendulum").position == (3.0, 0.0, 2.0)


def test_joints_hold_with_the_effort_of_their_limits(world: World, entities: Entities) -> None:
    strong = pendulum(limit='<limit lower="-1" upper="1" effort="100" velocity="9"/>')
    entities.add("pendulum", model(strong), BodyState((3.0, 0.0, 2.0)), "")
    run(world, 400)
    assert entities.bounds("pendulum")[1] == pytest.approx((1.0, 0.05, 0.05), abs=0.01)


def test_an_entity_without_shape_has_no_bounds_and_is_in_no_region(entities: Entities) -> None:
    entities.add("frame", model("<robot name='f'><link name='world'/></robot>"), BodyState((0.0, 0.0, 0.0)), "")
    assert entities.bounds("frame") is None
    assert select(entities, sphere((0.0, 0.0, 0.0), 1e3)) == ["ball", "talos"]


def test_the_category_of_an_entity_follows_from_its_mass_and_joints(entities: Entities) -> None:
    for name, text in (("crate", box()), ("table", box(mass=0)), ("pendulum", pendulum())):
        entities.add(name, model(text), BodyState((5.0, 0.0, 5.0)), name)
    categories = [entities.info(name).category for name in entities.names]
    robot, moving, still = Category.ROBOT, Category.DYNAMIC_OBJECT, Category.STATIC_OBJECT
    assert categories == [moving, robot, moving, still, robot]


def test_the_info_of_a_removed_entity_is_forgotten(world: World, entities: Entities) -> None:
    entities.add("crate", model(box()), BodyState((5.0, 0.0, 5.0)), "a crate")
    entities.set_info("crate", EntityInfo(Category.HUMAN, tags=("odd",)))
    entities.set_info("ball", EntityInfo(Category.OBJECT))
    entities.forget_infos()
    assert entities.info("crate").tags == ("odd",)
    assert entities.info("ball").category == Category.DYNAMIC_OBJECT
    entities.remove("crate")
    entities.add("crate", model(box()), BodyState((5.0, 0.0, 5.0)), "another")
    assert entities.info("crate") == EntityInfo(Category.DYNAMIC_OBJECT, "another")


def test_a_region_selects_a_box_that_it_touches(entities: Entities) -> None:
    entities.add("crate", model(box("2 2 2", mass=0)), BodyState((10.0, 0.0, 5.0)), "")

    def found(region: EntityFilters) -> bool:
        return "crate" in select(entities, region)

    assert found(sphere((10.0, 0.0, 5.0), 0.0))
    assert found(sphere((12.0, 2.0, 5.0), 1.42))
    assert not found(sphere((12.0, 2.0, 5.0), 1.41))
    assert found(within(Bounds.TYPE_BOX, (20.0, 20.0, 20.0), (10.9, 0.9, 5.9)))
    assert not found(within(Bounds.TYPE_BOX, (20.0, 20.0, 20.0), (11.1, 0.9, 5.9)))
    assert found(within(Bounds.TYPE_BOX, (float("inf"),) * 3, (-1e9,) * 3))


def test_bodies_stay_when_a_start_state_cannot_be_reached(world: World, entities: Entities) -> None:
    start = BodyState((5.0, 0.0, 5.0))
    entities.add("crate", model(box()), start, "")
    run(world, 10)
    with pytest.raises(ConfigError, match="falls through the floor of the cup"):
        world.reset(Config.model_validate({"tool": {"cup_floor_radius_m": 0.03}}))
    assert_same(entities.state("crate"), start)
    world.reset(CONFIG)
    assert_same(entities.state("crate"), start)
    assert entities.names == ("ball", "talos", "crate")


def test_a_body_on_which_the_ball_lies_can_be_taken_away(world: World, entities: Entities) -> None:
    entities.add("table", model(box(mass=0)), BodyState((5.0, 0.0, 1.0)), "")
    world.ball = BodyState((5.0, 0.0, 1.13))
    run(world, 200)
    assert [contact.body for contact in world.contacts()] == ["spoon", "table/body"]
    entities.remove("table")
    world.restart_clock(7)
    assert world.stamp_ns == 7
    assert world.contacts() == ()
    run(world, 50)
    assert world.ball.position[2] < 1.1
