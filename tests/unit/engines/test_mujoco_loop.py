"""The compiled loop over MuJoCo's steps computes the same bits as the loop in Python, and is kept where it can be."""

from __future__ import annotations

import ctypes
import hashlib
import math
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.introspect.structs import STRUCTS
from numpy.typing import NDArray
from tests.unit.engines.test_engine_contract import Watcher, begin, still, swing

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.engines.engine import BodyState
from throwcollect.engines.mujoco import loop, mujoco_engine, stepping
from throwcollect.engines.mujoco.loop import Loop, make_loop
from throwcollect.engines.mujoco.mujoco_engine import MujocoEngine
from throwcollect.errors import ConfigError
from throwcollect.plan.plan import Plan, make_trials
from throwcollect.plan.samplers import draw_points
from throwcollect.sim.simulator import Simulator

CONFIGS = Path(__file__).parents[3] / "configs"
BLOCK = """
object: block
scene: {landing_height_m: 0.2, bodies: {block: {shape: box, size_m: [0.05, 0.04, 0.03], mass_kg: 0.05, restitution: 0.6,
  position_m: [1.2, -0.1, 1.2], velocity_mps: [-3.0, 0.0, 1.5]}}}
sweep: {parameters: {"scene.bodies.block.velocity_mps.0": {min: -4.0, max: -2.5},
  "scene.bodies.block.velocity_mps.1": {min: -0.5, max: 0.3}}}
"""
"""A block flies to the robot and bounces off it; as nothing else is there, nothing is looked for while it is far."""
CAN = """
scene:
  bodies:
    table: {shape: box, size_m: [0.8, 1.2, 0.04], position_m: [1.6, -0.3, 0.5]}
    can: {shape: cylinder, radius_m: 0.04, length_m: 0.12, mass_kg: 0.1, position_m: [1.5, -0.25, 0.58],
      velocity_mps: [0.3, 0, 0]}
sweep: {parameters: {"task.end.arm_right_4_joint": {min: -0.8, max: -0.4}, "ball.restitution": {min: 0.0, max: 0.8}}}
"""
POLICY = """
task: {policy: {use: "tests.unit.engines.test_mujoco_loop:make_waver", rate_hz: 125, command: velocity}}
ball: {drag_coefficient: 0.4}
sweep: {parameters: {"ball.mass_kg": {min: 0.02, max: 0.06}}}
"""
CASES: Mapping[str, tuple[str, Sequence[str], set[str]]] = {
    "tool": ("quickstart", [], {"spoon"}),
    "drag, friction, delays, weak motors": ("randomised", [], {"spoon"}),
    "solid ground": ("quickstart", ["scene.landing_height_m=0.3", "ball.restitution=0.7"], {"spoon"}),
    "robot, by a block": (BLOCK, [], {"base_link", "torso_1_link"}),
    "body that moves": (CAN, [], {"spoon", "table"}),
    "bin, rolling friction": ("bin", [], {"spoon", "bin_floor"}),
    "slide": ("slide", [], {"paddle", "table"}),
    "release": ("claw", ["ball.drag_coefficient=0.4"], {"claw"}),
    "policy in slices": (POLICY, [], {"spoon"}),
    "1 kHz and few samples": ("quickstart", ["sim.physics_hz=1000", "record.rate_hz=50"], {"spoon"}),
    "other robot": ("ur5", [], {"spoon"}),
}


class Waver:
    """A policy that swings the arm by what it measures, in its own time."""

    def reset(self, seed: int, target: Mapping[str, float]) -> None:
        self.steps = 0

    def act(self, observation: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        self.steps += 1
        return np.full(5, 0.8 * math.sin(0.05 * self.steps) * observation["joint_position_rad"][0])


def make_waver(config: Config) -> Waver:
    return Waver()


@pytest.fixture
def in_python(monkeypatch: pytest.MonkeyPatch) -> Loop:
    monkeypatch.setattr(mujoco_engine, "_LOOP", loop._make_plain("this test wants it"))
    return mujoco_engine._LOOP


@pytest.fixture
def config(request: pytest.FixtureRequest, tmp_path: Path) -> Config:
    file, overrides, _ = CASES[request.param]
    path = CONFIGS / f"{file}.yaml"
    if "\n" in file:
        path = tmp_path / "case.yaml"
        path.write_text(file)
    return load(path, ["sim.engine=mujoco", "trials=6", "seed=7", *overrides])


def simulate(config: Config) -> tuple[str, set[str]]:
    """Simulate the trials of a configuration; return a hash over all that is recorded, and what touched the object."""
    plan = Plan(config, make_trials(config, draw_points(config, directory=CONFIGS)))
    simulator, digest, touched = Simulator(config), hashlib.sha256(), set()
    for trial in plan.trials:
        episode = simulator.run(trial)
        digest.update(episode.chunk.contents + repr((episode.header, episode.result)).encode())
        touched |= {contact.body for contact in episode.header.contacts}
    simulator.close()
    return digest.hexdigest(), touched


def test_the_loop_of_these_tests_is_compiled() -> None:
    assert make_loop().is_compiled
    assert MujocoEngine.describe_steps() == "compiled"


@pytest.mark.parametrize(("config", "touched"), [(case, each[2]) for case, each in CASES.items()], indirect=["config"])
def test_compiled_steps_have_the_bits_of_steps_in_python(
    config: Config, touched: set[str], request: pytest.FixtureRequest
) -> None:
    compiled, found = simulate(config)
    assert touched <= found
    request.getfixturevalue("in_python")
    assert simulate(config) == (compiled, found)


@pytest.mark.parametrize("config", ["tool", "solid ground", "robot, by a block", "release"], indirect=True)
def test_what_is_left_out_while_it_is_far_changes_no_bit(config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
    some_left_out = simulate(config)
    monkeypatch.setattr(mujoco_engine, "find_reach", lambda _: math.inf)
    assert simulate(config) == some_left_out


def test_a_ball_that_comes_near_in_one_step_touches_what_was_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for reach in (mujoco_engine.find_reach, lambda _: math.inf):
        monkeypatch.setattr(mujoco_engine, "find_reach", reach)
        engine, seen = MujocoEngine(), Watcher()
        begin(engine)
        # In each step it falls by 12 cm, and the ground is left out where it is farther than 11 cm.
        engine.place(0, BodyState((3.0, 0.0, 0.28), linear_velocity=(0.0, 0.0, -60.0)))
        engine.run(still(engine, 8), seen)
        found.append((seen.samples, seen.touches))
        engine.close()
    assert found[0] == found[1]
    assert {"ground"} in [bodies for _, bodies in found[0][1]]


def test_nothing_is_looked_for_only_while_the_ball_is_far_from_everything() -> None:
    engine, seen = MujocoEngine(), []

    class Looker(Watcher):
        def on_sample(self, step: int, sample: Any) -> bool:
            seen.append(bool(engine._model.opt.disableflags & stepping.EMPTY))
            return super().on_sample(step, sample)

    begin(engine)
    looker = Looker()
    engine.run(swing(600), looker)
    leaves = looker.touches[-1][0] // 2
    engine.close()
    assert not any(seen[:leaves])
    assert sum(seen[leaves:]) > 0.5 * len(seen[leaves:])


def test_boxes_of_bodies_are_around_their_shapes() -> None:
    engine = MujocoEngine()
    begin(engine)
    model, data = engine._model, engine._data
    for geom in range(model.ngeom):
        body = model.geom_bodyid[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        centre, half = model.geom_aabb[geom].reshape(2, 3)
        corners = np.array([centre + half * signs for signs in product((-1, 1), repeat=3)])
        world = data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T
        inside = (world - data.xipos[body]) @ data.ximat[body].reshape(3, 3)
        middle, edges = model.bvh_aabb[model.body_bvhadr[body]].reshape(2, 3)
        assert (np.abs(inside - middle) <= edges + 1e-9).all()
    engine.close()


def test_the_world_is_that_of_the_sample_at_which_an_observer_stops_also_on_the_way_back() -> None:
    ends = []
    for last in (200, 210):
        engine, seen = MujocoEngine(), Watcher(last=last)
        begin(engine)
        engine.run(swing(600), seen)
        assert engine.state.sample == seen.samples[-1][1]
        seen.last, seen.offset = None, last
        engine.run(swing(600 - last, first=last), seen)
        ends.append(seen)
        engine.close()
    assert ends[0].samples == ends[1].samples


def test_lengths_have_the_bits_of_pythons_own_function() -> None:
    numbers = np.random.default_rng(3)
    vectors = numbers.normal(size=(100_000, 3)) * 10.0 ** numbers.uniform(-6, 3, (100_000, 3))
    vectors[::7, 1] = 0.0
    assert [each for each in vectors.tolist() if stepping.measure_length(*each) != math.hypot(*each)] == []
    assert stepping.measure_length(0.0, 0.0, 0.0) == 0.0


def describe(name: str) -> Any:
    """Make a structure of MuJoCo by what its package says of its fields."""
    fields = [(field.name, find_type(field.type)) for field in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def find_type(declared: Any) -> Any:
    if hasattr(declared, "extents"):
        return find_type(declared.inner_type) * int(np.prod(declared.extents))
    if hasattr(declared, "inner_type"):
        return ctypes.c_void_p
    words = dict.fromkeys(("mjtSize", "size_t", "uintptr_t", "uint64_t"), ctypes.c_int64)
    known = {"mjtNum": ctypes.c_double, "int": ctypes.c_int, "mjtBool": ctypes.c_uint8, **words}
    return known.get(declared.name) or describe(declared.name)


def test_fields_are_where_the_headers_of_this_mujoco_have_them() -> None:
    data, contact, options = map(describe, ("mjData", "mjContact", "mjOption"))
    assert mujoco.__version__ == stepping.VERSION
    assert options.disableflags.offset - options.gravity.offset == stepping.FLAGS * 4
    assert data.ncon.offset == stepping.NCON * 4
    for field in ("arena", "contact", "efc_pos", "efc_vel", "efc_aref"):
        assert getattr(stepping, field.upper()) * 8 == getattr(data, field).offset, field
    assert ctypes.sizeof(contact) == stepping.CONTACT_SIZE * 4
    assert (contact.geom.offset, contact.efc_address.offset) == (stepping.GEOM * 4, stepping.EFC_ADDRESS * 4)


def test_another_mujoco_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco, "__version__", "4.0.1")
    with pytest.raises(ConfigError, match=r"needs MuJoCo 4\.0\.0, 4\.0\.1 is installed"):
        MujocoEngine()
    with pytest.raises(ConfigError, match="needs MuJoCo"):
        MujocoEngine.describe_steps()


def test_without_numba_steps_are_taken_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "llvmlite", None)
    made = make_loop.__wrapped__()
    assert not made.is_compiled
    assert made.made == "in Python, as Numba is not installed (try: pip install 'throwcollect[mujoco]')"


def refuse() -> bytes:
    raise AssertionError("it is compiled already")


def test_the_compiled_loop_is_kept_where_it_can_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    state = tmp_path / "state"
    monkeypatch.setenv("THROWCOLLECT_STATE", str(state))
    # Not even root can write there.
    monkeypatch.setattr(loop, "_DIRECTORY", Path("/proc/self"))
    assert loop._keep("1", lambda: b"code") == (b"code", "compiled")
    (kept,) = state.iterdir()
    assert loop._keep("1", refuse) == (b"code", "compiled")
    # LLVM would crash on a file that was cut, or whose content is another.
    whole = kept.read_bytes()
    for damaged in (b"", whole[:-1], whole[:-4] + b"done"):
        kept.write_bytes(damaged)
        assert loop._keep("1", lambda: b"code") == (b"code", "compiled")
        assert kept.read_bytes() == whole
    # Another LLVM compiles it anew.
    assert loop._keep("2", lambda: b"other") == (b"other", "compiled")
    monkeypatch.setattr(loop, "_DIRECTORY", tmp_path / "own" / "__pycache__")
    (tmp_path / "own").mkdir()
    assert loop._keep("3", lambda: b"code") == (b"code", "compiled")
    assert loop._keep("4", lambda: b"code") == (b"code", "compiled")
    assert loop._keep("4", refuse) == (b"code", "compiled")
    # What an earlier version has left there goes.
    assert len(list((tmp_path / "own" / "__pycache__").iterdir())) == 1
