"""How many episodes per second the coordinator takes in: unpack, judge, append to MCAP; one thread, no network."""

from __future__ import annotations

import random
import tempfile
import time
from pathlib import Path

from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.message import pack, unpack
from throwcollect.robots.model import joint_limits
from throwcollect.tasks.throw import judge
from throwcollect.tasks.trajectory import throw_trajectory


def measure(directory: Path) -> float:
    """Episodes per second, fed in random order.

    Args:
        directory: A finished dataset, whose episodes are collected once more.
    """
    dataset = Dataset.open(directory)
    messages = [pack(episode) for episode in dataset]
    random.Random(0).shuffle(messages)
    plan, limits = dataset.plan, joint_limits()
    configs = [plan.config_of(trial) for trial in plan.trials]
    trajectories = [throw_trajectory(config) for config in configs]
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        writer = DatasetWriter.create(Path(scratch) / "data", plan)
        began = time.perf_counter()
        for message in messages:
            episode = unpack(message)
            trial = episode.header.trial
            result = judge(
                episode.samples(),
                episode.header,
                config=configs[trial],
                trajectory=trajectories[trial],
                limits=limits,
            )
            writer.append(episode, result)
        seconds = time.perf_counter() - began
        writer.close()
    return len(messages) / seconds
