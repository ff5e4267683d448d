"""A random, a scripted and a trained policy that throw at targets in Gymnasium: ``python examples/policy_gym.py``.

The trained policy chooses a swing by a linear map from the target. The cross-entropy method learns the map: it tries
maps that are drawn around the best ones so far. This needs ``pip install 'throwcollect[collect,mujoco,gym]'`` and takes
a few minutes on 2 cores; ``--quick`` shows in seconds that it runs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import throwcollect.gym  # noqa: F401 - this registers the environments
from throwcollect import load_config

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
TARGETS = {"target_x_m": (1.3, 1.7), "target_y_m": (-0.4, -0.1)}
ENVS, RATE_HZ = 2, 50
TEST_SEED = 10**6  # seeds from here on draw the targets of the test, and those below the ones of the training

Array = NDArray[np.float64]
Act = Callable[[Mapping[str, Array]], Any]


class Swings:
    """Policies that swing by minimum jerk to the end of `configs/quickstart.yaml`, changed by a map from the target."""

    def __init__(self) -> None:
        config = load_config(CONFIG)
        self.start, self.end = (
            np.array([posture[joint] for joint in config.moving_joints])
            for posture in (config.task.start, config.task.end)
        )
        self.duration_s = config.task.duration_s
        self.shape = (1 + len(TARGETS), len(self.end) + 1)

    def make(self, weights: Array) -> Act:
        """Make the policy whose end posture [rad] and logarithm of the duration change by ``[1, x, y] @ weights``."""

        def act(observation: Mapping[str, Array]) -> Array:
            scaled = [(2 * observation[name] - low - high) / (high - low) for name, (low, high) in TARGETS.items()]
            change = np.hstack([np.ones((ENVS, 1)), *scaled]) @ weights
            x = np.minimum((observation["time_s"] + 1 / RATE_HZ) / (self.duration_s * np.exp(change[:, -1:])), 1.0)
            goal = self.end + change[:, :-1]
            return self.start + (10 * x**3 - 15 * x**4 + 6 * x**5) * (goal - self.start)

        return act


def play(envs: Any, act: Act, seeds: range) -> Array:
    """Play an episode for each seed; return its sum of rewards, whether it hit and its miss [m], shape ``(n, 3)``."""
    episodes = []
    for first in seeds[::ENVS]:
        observation, _ = envs.reset(seed=first)  # the environments get consecutive seeds
        total, results, playing = np.zeros(ENVS), np.zeros((ENVS, 3)), np.ones(ENVS, np.bool_)
        while playing.any():
            observation, reward, terminated, truncated, info = envs.step(act(observation))
            total += reward * playing
            ended = (terminated | truncated) & playing
            if ended.any():
                results[ended] = np.column_stack([total, info["is_success"], info["miss_m"]])[ended]
            playing &= ~ended
        episodes.append(results)
    return np.concatenate(episodes)


def train(envs: Any, swings: Swings, rng: np.random.Generator, rounds: int, samples: int, targets: int) -> Array:
    """Learn weights by the cross-entropy method; all samples of a round throw at the same targets."""
    mean, spread = np.zeros(swings.shape), np.full(swings.shape, 0.1)
    for number in range(rounds):
        seeds = range(number * targets, (number + 1) * targets)
        weights = mean + spread * rng.standard_normal((samples, *swings.shape))
        rewards = np.array([play(envs, swings.make(each), seeds)[:, 0].mean() for each in weights])
        best = weights[np.argsort(rewards)[-samples // 4 :]]
        mean, spread = best.mean(axis=0), best.std(axis=0)
        print(f"round {number + 1} of {rounds}: mean reward {rewards.mean():.2f}", flush=True)
    return mean


def main() -> None:
    """Train, and compare the policies at targets that the training has not seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="train and test for some seconds only")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rounds, samples, targets, tests = (1, 4, 2, 4) if arguments.quick else (15, 24, 4, 100)
    envs = gymnasium.make_vec(
        "throwcollect/Throw-v0",
        num_envs=ENVS,
        vectorization_mode="async",
        config=CONFIG,
        overrides=("sim.engine=mujoco",),
        rate_hz=RATE_HZ,
        observation=("time_s", *TARGETS),
        targets=TARGETS,
        reward="shaped",
    )
    envs.action_space.seed(arguments.seed)
    swings, began_s = Swings(), time.monotonic()
    weights = train(envs, swings, np.random.default_rng(arguments.seed), rounds, samples, targets)
    print(f"trained on {rounds * samples * targets} throws in {(time.monotonic() - began_s) / 60:.1f} min")
    policies: dict[str, Act] = {
        "random": lambda _: envs.action_space.sample(),
        "scripted": swings.make(np.zeros(swings.shape)),
        "trained": swings.make(weights),
    }
    print(f"{'policy':10}{'hits':>6}{'median miss':>14}{'reward':>9}")
    for name, act in policies.items():
        rewards, hits, misses = play(envs, act, range(TEST_SEED, TEST_SEED + tests)).T
        median_m = np.median(np.nan_to_num(misses, nan=np.inf))
        print(f"{name:10}{hits.mean():6.0%}{median_m:12.2f} m{rewards.mean():9.2f}")
    envs.close()


if __name__ == "__main__":
    main()
