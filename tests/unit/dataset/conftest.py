"""Throws like those of a simulation, made without one: joints on their trajectory, a ball in ballistic flight."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.unit.plan.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.dataset.creation import create
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import Contact, ControllerSamples, EpisodeHeader, GoalOutcome, Samples
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import Points
from throwcollect.robots.description import full_description, start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.free_flight import ballistic_positions
from throwcollect.tasks.task import task_of
from throwcollect.tasks.throw.throw_result import ThrowResult

SETTINGS: dict[str, Any] = {
    "name": "quick",
    "trials": 7,
    "record": {"trials_per_shard": 3},
    "sweep": {"sampler": "uniform", "parameters": {"task.duration_s": {"min": 0.8, "max": 1.2}}},
}
RELEASE_S = 0.4
SPIN_RADPS = 1.0
HOLDING = (0.5, -0.2, 1.3)

Change = Callable[[Samples, EpisodeHeader], tuple[Samples, EpisodeHeader]]


def throw(config: Config, trial: int) -> tuple[Samples, EpisodeHeader]:
    """A throw that lands, as samples and header."""
    random = np.random.default_rng(trial)
    rate, hz = config.record.rate_hz, config.sim.physics_hz
    start_ns = config.trial_start_ns(trial)
    speed = np.array([2.5, 0.1, 2.0]) + 0.2 * random.normal(size=3)
    held = round(RELEASE_S * rate)
    path = ballistic_positions(np.array(HOLDING), speed, steps=3 * hz, config=config)[:: hz // rate]
    flown = int(np.argmax(path[:, 2] < config.ball.radius_m + config.scene.landing_height_m)) + 1
    count = held + flown
    times = np.arange(count) / rate
    position = np.tile(list(start_posture(config).values()), (count, 1))
    velocity = np.zeros((count, len(TALOS.joints)))
    trajectory = task_of(config).trajectory()
    moving = [TALOS.joints.index(joint) for joint in trajectory.joints]
    position[:, moving], velocity[:, moving] = sample_quintic(trajectory, times)[:2]
    effort = np.zeros((count, len(TALOS.joints)))
    effort[:, moving] = 5 * np.sin(3 * times)[:, np.newaxis]
    ball_velocity = np.zeros((count, 3))
    ball_velocity[held:] = speed - np.outer(np.arange(flown) / rate, [0, 0, config.scene.gravity_mps2])
    angle = SPIN_RADPS * times / 2
    zero = np.zeros(count)
    turns = np.stack([zero, np.sin(angle), zero, np.cos(angle)])
    quaternion = np.array([0.1, -0.3, 0.2, 0.9])
    samples = Samples(
        stamps_ns=start_ns + np.arange(count, dtype=np.int64) * (1_000_000_000 // rate),
        position=position,
        velocity=velocity,
        effort=effort,
        object_position=np.concatenate([np.tile(HOLDING, (held, 1)), path[:flown]]),
        object_orientation_xyzw=_product(turns, quaternion / np.linalg.norm(quaternion)),
        object_linear_velocity=ball_velocity,
        object_angular_velocity=np.tile([0.0, SPIN_RADPS, 0.0], (count, 1)),
    )
    release = start_ns + round(RELEASE_S * 1e9)
    status = 4 if times[-1] >= trajectory.times[-1] else 2
    goals = tuple(GoalOutcome(name, status, 0, "") for name in ("arm_right_controller", "torso_controller"))
    return samples, EpisodeHeader(trial, start_ns, "landed", (Contact("spoon", start_ns, release),), goals, count)


def _product(turns: NDArray[np.float64], quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (xyzw), shape ``(4, n)``, times one; shape ``(n, 4)``."""
    x, y, z, w = turns
    a, b, c, d = quaternion
    return np.stack(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ],
        axis=1,
    )


def create_and_open(directory: Path, plan: Plan, *, listed: Points | None = None) -> DatasetWriter:
    create(directory, plan, listed=listed)
    return DatasetWriter(directory, plan)


class Collection:
    """A plan and the throws of its trials."""

    def __init__(self, settings: dict[str, Any] | None = None) -> None:
        self.config = Config.model_validate({**SETTINGS, **(settings or {})})
        self.plan: Plan = make_plan(self.config)
        self.columns = task_of(self.config).columns
        self.encoder = ChunkEncoder(
            Channels(self.config, full_description(self.config)), level=self.config.record.zstd_level
        )

    def episode(self, trial: int, change: Change | None = None) -> Episode:
        samples, header = throw(self.plan.config_of(self.plan.trials[trial]), trial)
        if change is not None:
            samples, header = change(samples, header)
        targets = {
            name: ControllerSamples(
                samples.stamps_ns - header.start_ns,
                *(np.zeros((len(samples), len(TALOS.controllers[name]))) for _ in range(4)),
            )
            for name in ("arm_right_controller", "torso_controller")
        }
        return Episode(header, self.encoder.encode(samples, targets)[0])

    def result(self, episode: Episode) -> ThrowResult:
        config = self.plan.config_of(self.plan.trials[episode.header.trial])
        task = task_of(config)
        return task.judge(episode.samples(), episode.header, task.trajectory())

    def fill(
        self, writer: DatasetWriter, trials: Iterable[int], *, lost: Iterable[int] = (), change: Change | None = None
    ) -> None:
        for trial in trials:
            if trial in lost:
                writer.append_lost(trial, "two simulations were lost")
            else:
                episode = self.episode(trial, change)
                writer.append(episode, self.columns.write(self.result(episode)))

    def collect(
        self,
        directory: Path,
        trials: Iterable[int] | None = None,
        *,
        lost: Iterable[int] = (),
        change: Change | None = None,
    ) -> Path:
        writer = create_and_open(directory, self.plan)
        self.fill(writer, range(len(self.plan.trials)) if trials is None else trials, lost=lost, change=change)
        writer.finish(simulations=2)
        writer.close()
        return directory

    def refuse(self, trial: int, reason: str) -> None:
        """Make the plan refuse one of its trials."""
        trials = self.plan.trials
        refused = dict(sorted({**trials.refused, trial: reason}.items()))
        self.plan = replace(self.plan, trials=replace(trials, refused=refused))


@pytest.fixture
def collection() -> Collection:
    return Collection()


@pytest.fixture(scope="session")
def make_collection() -> type[Collection]:
    return Collection


@pytest.fixture(scope="session")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Collection().collect(tmp_path_factory.mktemp("collected") / "dataset")


@pytest.fixture
def dataset(collected: Path, tmp_path: Path) -> Path:
    """A finished dataset that a test may spoil."""
    return Path(shutil.copytree(collected, tmp_path / "dataset"))
