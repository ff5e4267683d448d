"""Environments of Gymnasium: their spaces, episodes and rewards."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from throwcollect import ConfigError, Simulator
from throwcollect.errors import ConflictError, MemberError

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AsyncVectorEnv  # noqa: E402
from gymnasium.wrappers import FlattenObservation  # noqa: E402

import throwcollect.gym  # noqa: E402

CONFIG = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
OVERRIDES = ("sim.engine=mujoco", "sim.max_trial_s=1.5")
EYE = "sensors.eye={kind: camera, streams: [color, depth], width: 16, height: 16}"
TARGETS = {"target_x_m": (1.2, 1.8), "target_y_m": (-0.4, 0.0)}


def make(task: str = "Throw", **arguments: Any) -> Any:
    arguments = {"config": CONFIG, "overrides": OVERRIDES, **arguments}
    return gymnasium.make(f"throwcollect/{task}-v0", disable_env_checker=True, **arguments).unwrapped


@pytest.fixture(scope="module")
def aimed() -> Iterator[Any]:
    env = make(targets=TARGETS, reward="shaped")
    yield env
    env.close()


def play(env: Any, actions: Any) -> list[Any]:
    steps = []
    for action in actions:
        steps.append(env.step(action))
        if steps[-1][2] or steps[-1][3]:
            break
    return steps


@pytest.mark.parametrize(
    ("task", "arguments"),
    [
        ("Throw", {}),
        ("Throw", {"targets": TARGETS, "reward": "shaped"}),
        ("Throw", {"command": "velocity", "render_mode": "rgb_array"}),
        ("ThrowInto", {"config": None, "observation": ["ball_position_m", "task_bin_x_m"]}),
        ("Throw", {"overrides": (*OVERRIDES, EYE), "observation": ["joint_position_rad", "eye_image", "eye_depth"]}),
        ("Slide", {"config": CONFIG.with_name("slide.yaml"), "targets": {"target_x_m": (1, 2), "target_y_m": (-1, 0)}}),
    ],
)
def test_gymnasium_finds_no_fault(task: str, arguments: dict[str, Any]) -> None:
    env = make(task, **arguments)
    with warnings.catch_warnings():
        # It advises against bounds other than -1 and 1, and against infinite ones.
        warnings.simplefilter("ignore")
        check_env(env)
    env.close()


def test_an_episode_is_a_roll_out() -> None:
    rows = np.random.default_rng(0).uniform(-0.3, 0.3, (80, 5)) * [1, 1, 8, 4, 1]

    class Play:
        def reset(self, *_: object) -> None: ...

        def act(self, observation: Any) -> Any:
            return rows[round(observation["time_s"][0] * 50)]

    env = make(command="velocity")
    env.reset(options={"values": {"ball.mass_kg": 0.05}})
    *_, (last, reward, terminated, truncated, info) = play(env, rows)
    with Simulator(CONFIG, overrides=OVERRIDES) as simulator:
        rolled = simulator.roll_out(Play(), {"ball.mass_kg": 0.05}, command="velocity")
    assert info["outcome"] == rolled.outcome
    assert last["time_s"] == rolled.joints.time_s[-1]
    assert np.array_equal(last["ball_position_m"], rolled.ball.position[-1])
    assert {name: rolled[name] for name in ("clipped_share", "velocity_peak_share")}.items() <= info.items()
    assert (reward, terminated, truncated) == (0.0, True, False)
    with pytest.raises(ConflictError, match="this episode has ended"):
        env.step(rows[0])
    env.reset()
    with pytest.raises(MemberError, match="5 finite numbers"):
        env.step(rows[0, :3])
    env.close()


def test_shaped_rewards_add_up_to_the_way_to_the_target(aimed: Any) -> None:
    observation, _ = aimed.reset(seed=3, options={"target": {"target_x_m": 1.5}})
    assert observation["target_x_m"] == 1.5
    start = aimed._miss_m
    steps = play(aimed, [observation["command_position_rad"]] * 100)
    _, _, terminated, truncated, info = steps[-1]
    assert (terminated, truncated, info["outcome"], info["is_success"]) == (False, True, "not_released", False)
    assert sum(reward for _, reward, *_ in steps) == pytest.approx(start - aimed._miss_m)
    assert start == pytest.approx(np.hypot(*(observation["ball_position_m"][:2] - [1.5, observation["target_y_m"][0]])))


def test_targets_are_drawn_by_the_seed(aimed: Any) -> None:
    drawn = [aimed.reset(seed=seed)[0]["target_x_m"][0] for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]
    assert 1.2 <= drawn[0] <= 1.8


def test_environments_work_side_by_side() -> None:
    vector = AsyncVectorEnv([lambda: FlattenObservation(make(command="velocity"))] * 2)
    observations, _ = vector.reset(seed=[1, 2])
    assert observations.shape[0] == 2 < observations.shape[1]
    for _ in range(80):
        *_, late, info = vector.step(np.zeros((2, 5)))
        if late.any():
            break
    assert info["outcome"].tolist() == ["not_released"] * 2
    vector.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"task": "throw_into"}, r"task\.name: should be 'throw_into'.*got 'throw'"),
        ({"targets": {"target_x_m": (1, 2)}}, "target_y_m"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        throwcollect.gym.ThrowEnv(CONFIG, overrides=OVERRIDES, **arguments)
