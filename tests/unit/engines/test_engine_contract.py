"""The contract that every physics engine has to fulfil."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.engine import GROUND, BodyState, Engine, Observer, Sample, Scene, State, Steps, object_in
from throwcollect.extras import ENGINE_PACKAGES
from throwcollect.members import load_member, names_of
from throwcollect.robots.description import physics_description, start_posture
from throwcollect.robots.surroundings import object_of
from throwcollect.robots.tools.tool import tool_of
from throwcollect.sim.scene import physics_of, scene_of

CONFIG = Config.model_validate({"scene": {"landing_height_m": 0.5}})
DESCRIPTION = physics_description(CONFIG)
MOVING = DESCRIPTION.moving
SCENE = scene_of(CONFIG, DESCRIPTION)
PHYSICS = physics_of(CONFIG, MOVING)
SEAT = tool_of(CONFIG).ball_seat(CONFIG.ball.radius_m)
START = np.array([start_posture(CONFIG)[joint] for joint in MOVING])
END = np.array([CONFIG.task.end[joint] for joint in MOVING])
SPOON = SCENE.tool.name
STRIDE = 2


def scene_with(scene: Scene = SCENE, **ball: float) -> Scene:
    """Make a scene whose ball has other values of its keys."""
    changed = CONFIG.model_copy(update={"ball": CONFIG.ball.model_copy(update=ball)})
    return replace(scene, object=object_of(changed))


@dataclass
class Watcher(Observer):
    """Records touches and samples, and stops the steps at the sample of the step `last`."""

    last: int | None = None
    touches: list[tuple[int, frozenset[str]]] = field(default_factory=list)
    samples: list[tuple[int, Sample]] = field(default_factory=list)
    offset: int = 0

    def on_touch(self, step: int, bodies: frozenset[str]) -> None:
        self.touches.append((self.offset + step, bodies))

    def on_sample(self, step: int, sample: Sample) -> bool:
        self.samples.append((self.offset + step, sample))
        return step == self.last


def swing(steps: int, *, duration_s: float = 1.0, first: int = 0) -> Steps:
    """Minimum-jerk motion from the start to the end of the task; begins at the step `first` of it."""
    x = np.minimum(np.arange(first, first + steps + 1) / PHYSICS.hz / duration_s, 1.0) ** 1.2
    targets = START + (10 * x**3 - 15 * x**4 + 6 * x**5)[:, np.newaxis] * (END - START)
    return Steps(targets, np.diff(targets, axis=0) * PHYSICS.hz, STRIDE - first % STRIDE, STRIDE)


def still(engine: Engine, steps: int, *, drag_kgpm: float = 0.0) -> Steps:
    targets = np.tile(engine.state.sample[: len(MOVING)], (steps + 1, 1))
    return Steps(targets, np.zeros((steps, len(MOVING))), 1, 1, drag_kgpm)


def begin(engine: Engine) -> State:
    """Put the ball into the spoon, let it settle, and begin a trial from there."""
    engine.load(SCENE)
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.run(still(engine, 25), Observer())
    settled = engine.state
    engine.reset(settled)
    return settled


@pytest.fixture(params=names_of("engines"))
def name(request: pytest.FixtureRequest) -> str:
    if request.param in ENGINE_PACKAGES:
        # No version of Python has wheels of all engines.
        pytest.importorskip(ENGINE_PACKAGES[request.param].module)
    return str(request.param)


@pytest.fixture
def engine(name: str) -> Iterator[Engine]:
    made = load_member("engines", name)()
    begin(made)
    yield made
    made.close()


def watch_throw(engine: Engine) -> Watcher:
    seen = Watcher()
    assert engine.run(swing(600), seen) == 600
    return seen


def test_the_ball_rests_in_the_tool_of_the_still_robot(engine: Engine) -> None:
    state = engine.state
    assert state.touching == {SPOON}
    assert state.sample[: len(MOVING)] == pytest.approx(START, abs=1e-4)
    assert len(state.sample) == 3 * len(MOVING) + 13
    ball = object_in(state.sample)
    assert ball.linear_velocity == pytest.approx((0, 0, 0), abs=1e-4)
    engine.run(still(engine, 100), Observer())
    assert object_in(engine.state.sample).position == pytest.approx(ball.position, abs=1e-4)


def test_a_decimal_comma_of_the_process_changes_no_throw(name: str, use_decimal_comma: Callable[[], str]) -> None:
    def simulate() -> Watcher:
        made = load_member("engines", name)()
        begin(made)
        seen = watch_throw(made)
        made.close()
        return seen

    usual = simulate()
    use_decimal_comma()
    assert simulate() == usual


def test_renaming_the_root_link_does_not_change_a_throw(engine: Engine) -> None:
    usual = watch_throw(engine)
    # Most arms of example-robot-data stand on a link of this name.
    engine.load(replace(SCENE, robot=SCENE.robot.rename_links({SCENE.robot.links[0].name: "world"})))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.run(still(engine, 25), Observer())
    engine.reset(engine.state)
    assert watch_throw(engine) == usual


def test_a_throw_from_a_restored_state_does_not_depend_on_what_ran_before(name: str, engine: Engine) -> None:
    settled = begin(engine)
    first = watch_throw(engine)
    engine.reset(settled)
    assert watch_throw(engine) == first
    engine.place(0, BodyState((0.0, 0.05, 2.2), (0.0, 0.6, 0.0, 0.8), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0)))
    engine.run(still(engine, 100), Observer())
    begin(engine)
    assert watch_throw(engine) == first
    engine.load(scene_with(radius_m=0.03, mass_kg=0.2))
    engine.configure(replace(PHYSICS, gravity_mps2=3.0))
    engine.rest(END.tolist(), SEAT)
    engine.run(swing(50), Observer())
    begin(engine)
    assert watch_throw(engine) == first
    fresh = load_member("engines", name)()
    begin(fresh)
    assert watch_throw(fresh) == first
    fresh.close()


def test_single_steps_give_the_same_samples_as_many_at_once(engine: Engine) -> None:
    at_once, one_by_one = watch_throw(engine), Watcher()
    begin(engine)
    for number in range(600):
        one_by_one.offset = number
        assert engine.run(swing(1, first=number), one_by_one) == 1
    assert one_by_one.samples == at_once.samples
    assert one_by_one.touches == at_once.touches


def test_samples_are_taken_at_the_first_step_and_then_at_every_stride(engine: Engine) -> None:
    seen = Watcher()
    steps = replace(swing(20), first_sample=3, stride=4)
    engine.run(steps, seen)
    assert [number for number, _ in seen.samples] == [3, 7, 11, 15, 19]


def test_steps_that_an_observer_stops_can_be_continued(engine: Engine) -> None:
    whole = watch_throw(engine)
    begin(engine)
    seen = Watcher(last=400)
    assert engine.run(swing(600), seen) == 400
    assert engine.state.sample == seen.samples[-1][1]
    seen.last, seen.offset = None, 400
    assert engine.run(swing(200, first=400), seen) == 200
    assert (seen.samples, seen.touches) == (whole.samples, whole.touches)


def test_joints_reach_their_commanded_positions_at_each_sample(engine: Engine) -> None:
    steps = swing(600)
    seen = Watcher()
    engine.run(steps, seen)
    for number, sample in seen.samples:
        assert sample[: len(MOVING)] == pytest.approx(steps.targets[number], abs=1e-3)


def test_a_thrown_ball_leaves_the_tool_and_only_changes_of_touch_are_reported(engine: Engine) -> None:
    seen = watch_throw(engine)
    assert engine.state.touching == frozenset()
    assert seen.touches[-1][1] == frozenset()
    steps = [number for number, _ in seen.touches]
    assert steps == sorted(set(steps))
    states = [frozenset({SPOON}), *(bodies for _, bodies in seen.touches)]
    assert all(one != other for one, other in pairwise(states))
    assert 200 < steps[-1] < 500
    forward, _, height = object_in(engine.state.sample).position
    assert forward > 1.0
    assert height < 1.5


def test_a_free_ball_gets_its_velocity_from_gravity_before_it_moves(engine: Engine) -> None:
    engine.place(0, BodyState((3.0, 0.0, 2.0), linear_velocity=(1.0, -0.5, 2.0)))
    seen = Watcher()
    engine.run(still(engine, 100), seen)
    assert seen.touches == [(1, frozenset())]
    n = 100
    dt = 1 / PHYSICS.hz
    ball = object_in(engine.state.sample)
    fallen = PHYSICS.gravity_mps2 * dt * dt * n * (n + 1) / 2
    assert ball.position == pytest.approx((3.0 + n * dt, -0.5 * n * dt, 2.0 + 2.0 * n * dt - fallen), abs=1e-12)
    assert ball.linear_velocity == pytest.approx((1.0, -0.5, 2.0 - PHYSICS.gravity_mps2 * n * dt), abs=1e-12)


def test_drag_slows_the_ball_by_the_square_of_its_speed(engine: Engine) -> None:
    speed, drag_kgpm = 4.0, 0.01
    engine.place(0, BodyState((3.0, 0.0, 2.0), linear_velocity=(speed, 0.0, 0.0)))
    engine.run(still(engine, 1, drag_kgpm=drag_kgpm), Observer())
    lost = drag_kgpm * speed**2 / SCENE.object.inertia.mass_kg / PHYSICS.hz
    assert object_in(engine.state.sample).linear_velocity[0] == pytest.approx(speed - lost, rel=1e-9)


def test_only_solid_ground_stops_the_ball(engine: Engine) -> None:
    low = BodyState((2.0, 0.0, 0.2), linear_velocity=(0.0, 0.0, -2.0))
    engine.place(0, low)
    engine.run(still(engine, 100), Observer())
    assert engine.state.touching == {GROUND}
    assert object_in(engine.state.sample).position[2] == pytest.approx(SCENE.object.radius_m, abs=2e-3)
    engine.load(replace(SCENE, ground_is_solid=False))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.place(0, low)
    engine.run(still(engine, 100), Observer())
    assert engine.state.touching == frozenset()
    assert object_in(engine.state.sample).position[2] < -0.2


def test_ground_can_be_solid_for_some_steps_alone_and_leaves_no_trace(engine: Engine) -> None:
    engine.load(replace(SCENE, ground_is_solid=False))
    engine.configure(PHYSICS)
    engine.rest(START.tolist(), SEAT)
    engine.run(still(engine, 25), Observer())
    settled = engine.state
    engine.reset(settled)
    first = watch_throw(engine)
    for _ in range(2):
        engine.place(0, BodyState((2.0, 0.0, 0.2), linear_velocity=(0.0, 0.0, -2.0)))
        engine.run(replace(still(engine, 100), ground_is_solid=True), Observer())
        assert engine.state.touching == {GROUND}
        assert object_in(engine.state.sample).position[2] == pytest.approx(SCENE.object.radius_m, abs=2e-3)
    engine.place(0, BodyState((2.0, 0.0, 0.2)))
    engine.run(still(engine, 200), Observer())
    assert object_in(engine.state.sample).position[2] < -0.2
    engine.reset(settled)
    assert watch_throw(engine) == first


def test_a_placed_ball_has_exactly_the_given_state(engine: Engine) -> None:
    put = BodyState((1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8), (0.1, 0.2, 0.3))
    engine.place(0, put)
    assert object_in(engine.state.sample) == put
