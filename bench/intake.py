"""How many episodes per second the coordinator takes in: unpack, judge, append to MCAP; one thread, no network.

The raw limit beside it is what no judge and no format could do without: to decompress each chunk, check its CRC, and
write its bytes to a file, in the same thread.
"""

from __future__ import annotations

import random
import tempfile
import time
from pathlib import Path

import zstandard
from isal.isal_zlib import crc32

from throwcollect.coordinator.acceptance import Acceptance, PreparedTrial
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.message import Episode, pack, unpack
from throwcollect.run_key import Signer
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.result import Result
from throwcollect.tasks.task import task_of

_SIGNER = Signer(b"key of a run")


def measure(directory: Path) -> tuple[float, float]:
    """Episodes per second, fed in random order, and the raw limit.

    Args:
        directory: A finished dataset, whose episodes are collected once more.
    """
    dataset = Dataset.open(directory)
    acceptance = Acceptance(dataset.config)
    prepared = [acceptance.prepare(dataset.plan, trial) for trial in dataset.plan.trials]
    messages = [
        pack(episode, prepared[episode.header.trial].conditions.to_json(), _SIGNER) for episode in dataset.episodes()
    ]
    random.Random(0).shuffle(messages)
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        taken_in = _taken_in(messages, dataset.plan, acceptance, prepared, Path(scratch) / "data")
        return taken_in, _raw(messages, Path(scratch) / "raw")


def _taken_in(
    messages: list[bytes], plan: Plan, acceptance: Acceptance, prepared: list[PreparedTrial], directory: Path
) -> float:
    writer = DatasetWriter.create(directory, plan)
    _judge(unpack(messages[0], _SIGNER).episode, prepared)  # reads the robot's description, once in a process
    began = time.perf_counter()
    for message in messages:
        delivery = unpack(message, _SIGNER)
        episode = delivery.episode
        trial = prepared[episode.header.trial]
        if acceptance.foreign(delivery, trial, "") or acceptance.unsound(episode, trial):
            raise ValueError(f"trial {episode.header.trial} is refused")
        writer.append(episode, _judge(episode, prepared))
    seconds = time.perf_counter() - began
    writer.close()
    return len(messages) / seconds


def _judge(episode: Episode, prepared: list[PreparedTrial]) -> Result:
    trial = prepared[episode.header.trial]
    result: Result = task_of(trial.config).judge(episode.samples(), episode.header, trial.trajectory)
    return result


def _raw(messages: list[bytes], path: Path) -> float:
    chunks = [unpack(message, _SIGNER).episode.chunk for message in messages]
    decompressor = zstandard.ZstdDecompressor()
    began = time.perf_counter()
    with path.open("wb", buffering=0) as file:
        for chunk in chunks:
            if crc32(decompressor.decompress(chunk.data)) != chunk.crc:
                raise ValueError("a chunk's CRC differs from its contents")
            file.write(chunk.data)
    return len(messages) / (time.perf_counter() - began)
