"""A random and a scripted policy in an environment of Gymnasium: ``python examples/policy_gym.py``.

It needs ``pip install 'throwcollect[collect,gym]'``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import throwcollect.gym  # noqa: F401 - this registers the environments
from throwcollect import load_config

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
RATE_HZ = 50

Act = Callable[[dict[str, NDArray[np.float64]]], Any]


def swing(start: NDArray[np.float64], goal: NDArray[np.float64], duration_s: float) -> Act:
    """Make a policy that swings from a start to a goal [rad] by minimum jerk."""

    def act(observation: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        x = min((observation["time_s"][0] + 1 / RATE_HZ) / duration_s, 1.0)
        return start + (10 * x**3 - 15 * x**4 + 6 * x**5) * (goal - start)

    return act


def play(env: Any, act: Act, seed: int) -> tuple[str, float]:
    """Play an episode; return its outcome and the sum of its rewards."""
    observation, _ = env.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        total, ended = total + reward, terminated or truncated
    return info["outcome"], total


def main() -> None:
    """Play some episodes with each policy."""
    config = load_config(CONFIG)
    env = gymnasium.make(
        "throwcollect/Throw-v0",
        config=config,
        rate_hz=RATE_HZ,
        targets={"target_x_m": (1.3, 1.7), "target_y_m": (-0.4, -0.1)},
        reward="shaped",
    )
    start, goal = (
        np.array([angles[joint] for joint in config.moving_joints]) for angles in (config.task.start, config.task.end)
    )
    env.action_space.seed(0)
    policies: dict[str, Act] = {
        "random": lambda _: env.action_space.sample(),
        "scripted": swing(start, goal, config.task.duration_s),
    }
    for name, act in policies.items():
        for seed in range(3):
            outcome, reward = play(env, act, seed)
            print(f"{name}, seed {seed}: {outcome}, reward {reward:.2f}")
    env.close()


if __name__ == "__main__":
    main()
