"""From throws to a policy of LeRobot that throws at targets: collect, export, train, and score it (docs/learning.md).

On Python 3.12, with ``throwcollect[collect]`` and ``lerobot[dataset]``:
``python examples/policy_lerobot.py configs/quickstart.yaml out``.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow.csv
import torch
from lerobot.configs.types import NormalizationMode
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot.utils.feature_utils import dataset_to_policy_features

import throwcollect

RATE_HZ = 25
CHUNK = 33
"""Frames of the longest swing, which the policy commands at once."""
INPUTS = ("observation.state", "observation.environment_state")


def main() -> None:
    """Do all steps, and compare the policy with two that do not look at the target."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", help="configuration of the sweep")
    parser.add_argument("out", type=Path, help="directory for all results")
    parser.add_argument("--trials", type=int, default=512)
    parser.add_argument("--steps", type=int, default=2500, help="steps of training")
    parser.add_argument("--targets", type=int, default=20)
    parser.add_argument("--quick", action="store_true", help="only show that all steps work")
    options = parser.parse_args()
    if options.quick:
        options.trials, options.steps, options.targets = 32, 2, 2
    collect(options.config, options.out, options.trials)
    train(options.out / "export", options.out / "policy", options.steps)
    for name in ("trained", "mean", "hold"):
        use = f"{Path(__file__).stem}:make_{name}"
        rate = f"task.policy={{use: {use}, rate_hz: {RATE_HZ}}}"
        number = ("--targets", options.targets, "--seeds", 1)
        run("score", options.out / "aimed", "--policy", use, "--set", rate, *number, POLICY=str(options.out / "policy"))


def run(*words: object, **variables: str) -> None:
    """Run a command of throwcollect, which finds policies in this file."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent), **variables}
    subprocess.run([sys.executable, "-m", "throwcollect", *map(str, words)], env=environment, check=True)


def collect(config: str, out: Path, trials: int) -> None:
    """Sweep, learn from that how to aim, throw at each place where the ball has landed, and export these throws.

    Of the many motions that lead to a target, the one with the least effort changes smoothly from target to target.
    """
    engine = ("--set", "sim.engine=mujoco")
    run("up", "-n", 2, config, *engine, "--trials", trials, "-o", out / "swept")
    run("fit", out / "swept", "-o", out / "model")
    landed = throwcollect.load(out / "swept").select("outcome == 'landed'")
    pyarrow.csv.write_csv(landed.throws.select(["landing_x_m", "landing_y_m"]), out / "targets.csv")
    run("aim", out / "model", "--targets", out / "targets.csv", "--choose", "least-effort", "-o", out / "throws.csv")
    sweep = f"sweep={{sampler: list, file: {(out / 'throws.csv').resolve()}}}"
    run("up", "-n", 2, config, *engine, "--set", sweep, "--set", "trials=null", "-o", out / "aimed")
    run("dataset", "export", out / "aimed", out / "export", "--to", "lerobot", "--rate", RATE_HZ)


def train(export: Path, policy: Path, steps: int) -> None:
    """Train a small ACT from the first observation of a throw, which holds the target, to all commands of its swing."""
    torch.manual_seed(0)
    ahead = {"action": [frame / RATE_HZ for frame in range(CHUNK)]}
    dataset = LeRobotDataset("me/throws", root=export, delta_timestamps=ahead)
    features = dataset_to_policy_features(dataset.meta.features)
    config = ACTConfig(
        input_features={name: features[name] for name in INPUTS},
        output_features={"action": features["action"]},
        # ACT does not normalise what is not named here; ENV is not, by default.
        normalization_mapping=dict.fromkeys(("STATE", "ENV", "ACTION"), NormalizationMode.MEAN_STD),
        chunk_size=CHUNK,
        n_action_steps=CHUNK,
        dim_model=128,
        dim_feedforward=512,
        n_heads=4,
        n_encoder_layers=2,
        use_vae=False,
        dropout=0.0,
        device="cpu",
    )
    network = ACTPolicy(config)
    before, after = make_pre_post_processors(config, dataset_stats=dataset.meta.stats)
    names = (*INPUTS, "action", "action_is_pad")
    starts = [dataset[first] for first in dataset.meta.episodes["dataset_from_index"]]
    throws = before({name: torch.stack([start[name] for start in starts]) for name in names})
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=0)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 1e-3, total_steps=steps)
    network.train()
    for step in range(steps):
        chosen = torch.randint(len(starts), (16,))
        loss, _ = network({name: throws[name][chosen] for name in names})
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        if step % 250 == 0:
            print(f"step {step} of {steps}: loss {loss.item():.3f}", flush=True)
    for part in (network, before, after):
        part.save_pretrained(policy)
    np.save(policy / "mean.npy", torch.stack([start["action"] for start in starts]).mean(dim=0).numpy())


class Chunk:
    """A policy that chooses all commands at once when it first observes, and then keeps to them."""

    def __init__(self, config: throwcollect.Config) -> None:
        joints = config.robot.find().joints
        self.moving = [joints.index(joint) for joint in config.moving_joints]

    def reset(self, seed: int, target: Mapping[str, float]) -> None:
        """Begin a trial."""
        self.frame, self.chunk = 0, None

    def act(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the next command; the last one again when there are no more."""
        if self.chunk is None:
            self.chunk = self.choose(observation)
        command = self.chunk[min(self.frame, len(self.chunk) - 1)]
        self.frame += 1
        return command

    def choose(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Choose commands of shape ``(n_frames, n_moving)``; here, to hold the posture, as an identity model would."""
        return observation["command_position_rad"][np.newaxis]


class Mean(Chunk):
    """Plays back the mean of all throws."""

    def choose(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.load(Path(os.environ["POLICY"]) / "mean.npy")


class Trained(Chunk):
    """Plays back what the network predicts for the target."""

    def __init__(self, config: throwcollect.Config) -> None:
        super().__init__(config)
        torch.set_num_threads(1)
        self.network = ACTPolicy.from_pretrained(os.environ["POLICY"])
        self.before, self.after = make_pre_post_processors(self.network.config, os.environ["POLICY"])

    def choose(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        state = [observation[name][self.moving] for name in ("joint_position_rad", "joint_velocity_radps")]
        world = [observation[name] for name in ("ball_position_m", "ball_velocity_mps", "target_x_m", "target_y_m")]
        arrays = zip(INPUTS, map(np.concatenate, (state, world)), strict=True)
        batch = self.before({name: torch.from_numpy(array.astype(np.float32)) for name, array in arrays})
        chunk = self.after(self.network.predict_action_chunk(batch))[0].numpy()
        return smooth(chunk, observation["command_position_rad"])


def smooth(chunk: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Fit a polynomial of degree 9 that starts at rest.

    Frames of a network are a few milliradians off, each in its own direction, which is enough to shake the ball out.
    """
    powers = np.arange(1, len(chunk) + 1)[:, np.newaxis] / len(chunk)
    powers = powers ** np.arange(3, 10)
    return start + powers @ np.linalg.lstsq(powers, chunk - start, rcond=None)[0]


make_trained, make_mean, make_hold = Trained, Mean, Chunk

if __name__ == "__main__":
    main()
