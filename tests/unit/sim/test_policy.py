"""A policy in the loop: what it observes, what becomes of its commands, and what is said of a wrong one."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from throwcollect import ConfigError, Simulator, Throw
from throwcollect.errors import MemberError
from throwcollect.publish.export.throw_source import list_signals
from throwcollect.robots.description import start_posture
from throwcollect.sim.policy import Observation, shape_observation
from throwcollect.sim.world import World

pytest.importorskip("mujoco")

CONFIG = Path(__file__).parents[3] / "configs" / "quickstart.yaml"
OVERRIDES = ("sim.engine=mujoco", "sim.max_trial_s=1.5")
Act = Callable[[Observation], Any]


class Acts:
    """A policy that is one function of its observation."""

    def __init__(self, act: Act) -> None:
        self.act, self.seeds, self.targets = act, [], []

    def reset(self, seed: int, target: dict[str, float]) -> None:
        self.seeds.append(seed)
        self.targets.append(target)


def hold(observation: Observation) -> NDArray[np.float64]:
    return observation["command_position_rad"]


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(CONFIG, overrides=OVERRIDES) as simulator:
        yield simulator


def assert_same_samples(one: Throw, other: Throw) -> None:
    first, second = one.read_samples()[1], other.read_samples()[1]
    for field in fields(first):
        if field.name != "command":
            assert np.array_equal(getattr(first, field.name), getattr(second, field.name)), field.name


@contextmanager
def noting_commands() -> Iterator[list[NDArray[np.float64]]]:
    """Note the set points of all physics steps."""
    commands: list[NDArray[np.float64]] = []
    run = World.run

    def note(world: World, rows: NDArray[np.float64], **rest: Any) -> int:
        taken = run(world, rows, **rest)
        commands.extend(rows[:taken].copy())
        return taken

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(World, "run", note)
        yield commands


def test_each_command_is_reached_when_the_policy_is_asked_again(simulator: Simulator) -> None:
    random = np.random.default_rng(0)
    with noting_commands() as commands:
        rolled = simulator.roll_out(Acts(lambda seen: hold(seen) + random.uniform(-0.01, 0.01, 5)))
    sent = rolled.read_samples()[1].command[::5, 1]
    count = len(commands) // 10
    assert np.array_equal(np.array(commands)[9::10][:count], sent[:count])


def test_commands_of_a_throw_played_back_give_that_throw(simulator: Simulator) -> None:
    with noting_commands() as commands:
        throw = simulator.throw()
    play = Acts(lambda observation: commands[round(observation["time_s"][0] * 500)])
    again = simulator.roll_out(play, rate_hz=500)
    assert_same_samples(throw, again)
    assert (again.outcome, again["clipped_share"]) == (throw.outcome, 0) == ("landed", 0)
    # At 50 Hz, there is a command for every tenth step, to be reached at the end of these.
    play = Acts(lambda observation: commands[min(round(observation["time_s"][0] * 500) + 9, len(commands) - 1)])
    coarse = simulator.roll_out(play)
    assert coarse.outcome == "landed"
    difference = coarse.events.landing.position - throw.events.landing.position
    assert 1e-6 < np.abs(difference).max() < 5e-3


def test_a_constant_policy_holds_the_posture(simulator: Simulator) -> None:
    rolled = simulator.roll_out(Acts(hold))
    assert_same_samples(rolled, simulator.roll_out(Acts(hold), rate_hz=250))
    assert_same_samples(rolled, simulator.roll_out(Acts(lambda _: np.zeros(5)), command="velocity"))
    world = World(simulator.config)
    posture = start_posture(simulator.config)
    world.run(np.tile([posture[joint] for joint in world.moving], (2000, 1)))
    still = world.samples()
    world.close()
    assert len(still) == len(rolled.joints)
    assert np.array_equal(still.position, rolled.joints.position)
    assert np.array_equal(still.object_position, rolled.ball.position)


def test_observations_have_the_names_and_shapes_of_exports(simulator: Simulator) -> None:
    seen: list[Observation] = []
    policy = Acts(lambda observation: seen.append(observation) or hold(observation))
    target = {"target_x_m": 1.5, "target_y_m": -0.2}
    throw = simulator.roll_out(policy, target=target, trial=3)
    config = simulator.config
    signals = list_signals(config, config.task.target_columns)
    exported = {signal.name: max(len(signal.components), 1) for signal in signals}
    known = shape_observation(config)
    assert known.items() - exported.items() == {("scene_landing_height_m", 1)}
    first = seen[0]
    assert {name: array.shape for name, array in first.items()} == {
        name: (size,) for name, size in known.items() if not name.startswith("target_") or name in target
    }
    assert np.array_equal(first["joint_position_rad"], throw.joints.position[0])
    assert np.array_equal(seen[10]["ball_position_m"], throw.ball.position[50])
    assert np.array_equal(seen[10]["joint_effort_nm"], throw.joints.effort[50])
    assert first["target_x_m"] == 1.5
    assert policy.targets == [target]
    simulator.roll_out(policy)
    assert policy.seeds[0] != policy.seeds[1]
    few = simulator.roll_out(policy, observation=["ball_position_m", "command_position_rad"])
    assert [*seen[-1]] == ["ball_position_m", "command_position_rad"]
    assert_same_samples(few, simulator.roll_out(policy))


def test_pictures_of_cameras_are_observed_by_name() -> None:
    sensors = """sensors={
      side: {kind: camera, streams: [color, depth], depth_encoding: 32FC1, rate_hz: 50},
      wrist: {kind: depth, link: arm_right_7_link, width: 32, height: 24, depth_encoding: 32FC1, rate_hz: 50},
      scan: {kind: lidar_2d}}"""
    seen: list[Observation] = []
    policy = Acts(lambda observation: seen.append(observation) or hold(observation) + 0.005)
    names = ["side_image", "side_depth", "wrist_depth"]
    with Simulator(CONFIG, overrides=(*OVERRIDES, "record.rate_hz=250", sensors)) as simulator:
        rolled = simulator.roll_out(policy, observation=["command_position_rad", *names])
        assert not any(name in seen[0] for name in shape_observation(simulator.config) if name.endswith("_position_m"))
        for frame in (0, 10, len(seen) - 1):
            side, wrist = rolled.sensors["side"], rolled.sensors["wrist"]
            assert np.array_equal(seen[frame]["side_image"], side.images[frame])
            assert np.array_equal(seen[frame]["side_depth"][..., 0], side.depth_m[frame])
            assert np.array_equal(seen[frame]["wrist_depth"][..., 0], wrist.depth_m[frame])
        assert {name: (seen[0][name].shape, seen[0][name].dtype) for name in names} == {
            "side_image": ((96, 96, 3), np.uint8),
            "side_depth": ((96, 96, 1), np.float32),
            "wrist_depth": ((24, 32, 1), np.float32),
        }
        assert not np.array_equal(seen[0]["side_image"], seen[-1]["side_image"])
        # What costs time is observed only by name.
        simulator.roll_out(policy)
        assert not {*names} & {*seen[-1]}
        with pytest.raises(ConfigError, match=r"there is no wrist_image.*side_image, side_depth, wrist_depth"):
            simulator.roll_out(policy, observation=["wrist_image"])


def test_commands_beyond_limits_are_clipped_counted_and_recorded(simulator: Simulator) -> None:
    rolled = simulator.roll_out(Acts(lambda observation: hold(observation) + 10))
    assert rolled["clipped_share"] == 1
    asked, sent = rolled.read_samples()[1].command.swapaxes(0, 1)
    assert asked.shape == (len(rolled.joints), 5)
    assert (asked > sent).all()
    # The first command is as far as the velocity limit lets the joint go in 20 ms.
    assert 0 < sent[0][2] - start_posture(simulator.config)["arm_right_4_joint"] < 0.2
    assert "clipped_share" not in simulator.throw()


def fail(_: Observation) -> None:
    raise RuntimeError("the network is lost")


def be_late(observation: Observation) -> NDArray[np.float64]:
    time.sleep(0.02)
    return hold(observation)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda seen: hold(seen) if seen["time_s"] < 0.3 else fail(seen), r"at 0\.300 s of trial 2: Run.*network is"),
        (lambda seen: hold(seen)[:4], r"act at 0\.000 s of trial 2: ValueError: .* 5 finite numbers, for arm_right_1_"),
        (lambda seen: hold(seen) * np.nan, r"5 finite numbers, .* got \[nan"),
        (lambda _: "left", r"could not convert string"),
    ],
)
def test_a_wrong_command_names_trial_and_time(simulator: Simulator, act: Act, message: str) -> None:
    with pytest.raises(MemberError, match=message):
        simulator.roll_out(Acts(act), trial=2)
    # The next one is not concerned.
    assert simulator.roll_out(Acts(hold)).outcome == "not_released"


def test_a_policy_that_is_too_slow_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_lab.py").write_text("make = lambda config: policy\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    import slow_lab

    slow_lab.policy = Acts(be_late)
    policy = "task.policy={use: slow_lab:make, timeout_s: 0.01}"
    with (
        Simulator(CONFIG, overrides=(*OVERRIDES, policy)) as simulator,
        pytest.raises(MemberError, match=r"slow_lab:make cannot act at 0\.000 s .* task\.policy\.timeout_s is 0\.01"),
    ):
        simulator.throw()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rate_hz": 60}, r"task\.policy\.rate_hz: should divide sim\.physics_hz, 500, got 60"),
        ({"observation": ["target_x_m"]}, r"trial 0 has no target_x_m: its plan has no targets"),
    ],
)
def test_wrong_settings_of_a_policy_name_the_key(simulator: Simulator, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        simulator.roll_out(Acts(hold), **settings)
