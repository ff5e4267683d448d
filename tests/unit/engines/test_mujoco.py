"""What MuJoCo does beyond the contract of engines: contacts, motors, reproducible results."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.engines.test_engine_contract import (
    MOVING,
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

from throwcollect.engines.body import HERE, LinkShape
from throwcollect.engines.engine import BodyState, Observer, Physics, Scene, object_in
from throwcollect.engines.mujoco.mujoco_engine import MujocoEngine
from throwcollect.engines.mujoco.scenery import make_spec, resize_object

TRIALS: list[tuple[Scene, Physics]] = [
    (SCENE, PHYSICS),
    (scene_with(radius_m=0.02, mass_kg=0.06), PHYSICS),
    (scene_with(friction=0.2, restitution=0.6), replace(PHYSICS, velocity_gain=0.7)),
    (SCENE, replace(PHYSICS, gravity_mps2=3.0, efforts=tuple(0.7 * effort for effort in PHYSICS.efforts))),
    (replace(SCENE, ground_is_solid=False), replace(PHYSICS, surface_friction=1.0, solver_iterations=10)),
]


@pytest.fixture
def engine() -> Iterator[MujocoEngine]:
    made = MujocoEngine()
    begin(made)
    yield made
    made.close()


def trial(engine: MujocoEngine, scene: Scene, physics: Physics) -> Watcher:
    engine.load(scene)
    engine.configure(physics)
    engine.rest(START.tolist(), SEAT)
    seen = Watcher()
    engine.run(still(engine, 25), seen)
    engine.reset(engine.state)
    engine.run(swing(600), seen)
    return seen


def alone(number: int) -> Watcher:
    engine = MujocoEngine()
    seen = trial(engine, *TRIALS[number])
    engine.close()
    return seen


@pytest.fixture(scope="module")
def each_alone() -> list[Watcher]:
    return [alone(number) for number in range(len(TRIALS))]


def test_worlds_in_several_threads_do_not_affect_each_other(each_alone: list[Watcher]) -> None:
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(alone, range(len(TRIALS)))) == each_alone


def test_the_ball_leaves_the_tool_only_once(engine: MujocoEngine) -> None:
    # With the default contacts of MuJoCo, the ball hops some 15 times before it leaves.
    seen = Watcher()
    engine.run(swing(600), seen)
    assert [bodies for _, bodies in seen.touches] == [frozenset()]


def test_motors_follow_their_targets_closely_while_they_carry_the_ball(engine: MujocoEngine) -> None:
    steps, seen = swing(600), Watcher()
    engine.run(steps, seen)
    errors = [np.abs(np.array(sample[: len(MOVING)]) - steps.targets[number]).max() for number, sample in seen.samples]
    assert max(errors) < 2e-5


def test_motors_that_are_too_weak_give_no_more_than_their_largest_effort(engine: MujocoEngine) -> None:
    weak = tuple(0.5 * effort for effort in PHYSICS.efforts)
    seen = trial(engine, SCENE, replace(PHYSICS, efforts=weak))
    shares = [np.abs(sample[2 * len(MOVING) : 3 * len(MOVING)]) / weak for _, sample in seen.samples]
    assert np.max(shares) == 1.0


@pytest.mark.parametrize("speed", [0.5, 3.0, 8.0])
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.7, 1.0])
def test_a_ball_bounces_off_the_ground_by_its_restitution(
    engine: MujocoEngine, restitution: float, speed: float
) -> None:
    engine.load(scene_with(restitution=restitution))
    engine.configure(replace(PHYSICS, gravity_mps2=1e-9))
    engine.place(0, BodyState((2.0, 0.0, 0.1), linear_velocity=(0.0, 0.0, -speed)))
    seen = Watcher()
    engine.run(still(engine, 120), seen)
    assert object_in(seen.samples[-1][1]).linear_velocity[2] == pytest.approx(restitution * speed, abs=0.01 * speed)
    assert min(object_in(sample).position[2] for _, sample in seen.samples) > SCENE.object.radius_m - 1e-3


@pytest.mark.parametrize(
    ("kind", "before", "after"),
    [("sphere", (0.03,), (0.04,)), ("cylinder", (0.03, 0.02), (0.04, 0.05)), ("box", (0.1, 0.2, 0.3), (0.2, 0.1, 0.1))],
)
def test_a_resized_object_gives_the_same_model_as_one_compiled_at_that_size(
    kind: str, before: tuple[float, ...], after: tuple[float, ...]
) -> None:
    one, other = (
        replace(SCENE.object, link=replace(SCENE.object.link, shapes=(LinkShape(kind, size, HERE),)))
        for size in (before, after)
    )
    spec, _ = make_spec(replace(SCENE, object=one))
    resized = spec.compile()
    resize_object(resized, other)
    spec, _ = make_spec(replace(SCENE, object=other))
    compiled = spec.compile()
    # These arrays are computed from the inertia, which is set with the mass.
    derived = ("inertia", "inertia0", "invweight0", "M0", "acc0", "stat")
    arrays = [name for name in dir(compiled) if isinstance(getattr(compiled, name), np.ndarray)]
    assert len(arrays) > 300
    for name in arrays:
        if not name.endswith(derived):
            np.testing.assert_array_equal(getattr(resized, name), getattr(compiled, name), err_msg=name)


def test_a_diverging_world_has_numbers_that_are_not_finite_and_can_begin_again(
    engine: MujocoEngine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = Watcher()
    engine.run(swing(600), whole)
    engine.place(0, BodyState((1.0, 2.0, 3.0), linear_velocity=(1e300, 0.0, 0.0)))
    engine.run(still(engine, 20), Observer())
    assert not np.isfinite(engine.state.sample).all()
    begin(engine)
    again = Watcher()
    engine.run(swing(600), again)
    assert again == whole
    assert list(tmp_path.iterdir()) == []
