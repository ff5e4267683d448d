"""A small dataset with every case that exporters must handle, and its throws as they should be exported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.conftest import make_collection as make_collection

from throwcollect import runs
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.publish.export.export import export
from throwcollect.robots.talos import TALOS
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.task import task_of

FORMATS = ("parquet", "npz", "lerobot", "hdf5", "mat")
"""The formats of this project; a package in `tests/plugins` adds another one."""
SETTINGS: dict[str, Any] = {
    "trials": 6,
    "record": {"trials_per_shard": 3},
    "sweep": {
        "sampler": "uniform",
        "parameters": {
            "task.duration_s": {"min": 0.8, "max": 1.2},
            "task.end.arm_right_4_joint": {"min": -0.9, "max": -0.3},
        },
    },
}
LOST, REFUSED, HELD = 1, 5, 3
WITH_EPISODE = [0, 2, 3, 4]
MOVING = ["arm_right_1_joint", "arm_right_2_joint", "arm_right_4_joint", "arm_right_7_joint", "torso_1_joint"]

Arrays = dict[str, np.ndarray]
Export = Callable[..., Path]


def as_in_life(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """Joints are never quite where they should be, and the ball of one trial stays in the spoon."""
    samples = replace(samples, position=samples.position + 1e-3, velocity=samples.velocity + 1e-2)
    if header.trial != HELD:
        return samples, header
    return samples, replace(header, end_reason="timeout", contacts=(replace(header.contacts[0], end_ns=None),))


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    collection = Collection(SETTINGS)
    collection.refuse(REFUSED, "too far")
    directory = tmp_path_factory.mktemp("source") / "dataset"
    return collection.collect(directory, [0, 1, 2, 3, 4], lost=[LOST], change=as_in_life)


@pytest.fixture(scope="session")
def exported(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Export:
    """Exports the dataset to a format at a rate, only once for all tests."""
    made: dict[tuple[str, int | None], Path] = {}

    def make(to: str, rate_hz: int | None = None) -> Path:
        if (to, rate_hz) not in made:
            made[to, rate_hz] = tmp_path_factory.mktemp("exports") / to
            export(source, made[to, rate_hz], to=to, rate_hz=rate_hz)
        return made[to, rate_hz]

    return make


SEEN = """\
name: seen
trials: 3
seed: 4
sim: {engine: ballistic}
record: {trials_per_shard: 2, topics: [joint_states, ball/odometry]}
run: {replay: 0}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}
sensors:
  side: {kind: camera, width: 64, height: 48, rate_hz: 25, streams: [color, depth]}
  head:
    {kind: camera, link: head_2_link, position_m: [0.1, 0, 0], width: 32, height: 32, noise: {color_std: 3}}
  front: {kind: depth, width: 16, height: 12, depth_encoding: 32FC1}
  scan: {kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0], rays: 36}
"""


@pytest.fixture(scope="session")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with cameras, of 10 and 25 Hz, and a lidar."""
    directory = tmp_path_factory.mktemp("seen")
    (directory / "config.yaml").write_text(SEEN)
    with runs.prepare(
        directory / "config.yaml", overrides=["run.runtime=inprocess"], output=directory / "dataset"
    ) as run:
        run.collect()
    return directory / "dataset"


def throws_of(directory: Path, step: int = 1) -> Iterator[tuple[int, Arrays]]:
    """Trial and signals of each throw, straight from the recordings: every `step`-th sample."""
    dataset = Dataset.open(directory)
    for episode in dataset.episodes():
        trial = episode.header.trial
        samples = episode.samples()[::step]
        time_s = (samples.stamps_ns - episode.header.start_ns) / 1e9
        trajectory = task_of(dataset.plan.config_of(dataset.plan.trials[trial])).trajectory()
        path, speed, acceleration = sample_quintic(trajectory, time_s)
        yield (
            trial,
            {
                "time_s": time_s,
                "joint_position_rad": samples.position,
                "joint_velocity_radps": samples.velocity,
                "joint_effort_nm": samples.effort,
                "command_position_rad": path,
                "command_velocity_radps": speed,
                "command_acceleration_radps2": acceleration,
                "ball_position_m": samples.object_position,
                "ball_orientation_xyzw": samples.object_orientation_xyzw,
                "ball_velocity_mps": samples.object_linear_velocity,
                "ball_angular_velocity_radps": samples.object_angular_velocity,
            },
        )


def actions_of(directory: Path, step: int = 1, recorded_hz: int = 250) -> list[np.ndarray]:
    """The action of each sample of each throw: what its trajectory commands one sample later."""
    plan = Dataset.open(directory).plan
    return [
        sample_quintic(
            task_of(plan.config_of(plan.trials[trial])).trajectory(),
            np.append(signals["time_s"][1:], signals["time_s"][-1] + step / recorded_hz),
        )[0]
        for trial, signals in throws_of(directory, step)
    ]


def moving_columns() -> list[int]:
    return [TALOS.joints.index(joint) for joint in MOVING]


def table_of(directory: Path) -> dict[str, list[Any]]:
    """The table of throws without the places of recordings."""
    return Dataset.open(directory).throws.drop_columns(["shard", "chunk_offset"]).to_pydict()
