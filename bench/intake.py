"""How many episodes per second the coordinator takes in: unpack, check, append to MCAP; one thread, no network.

The raw limit beside it is what nobody could do without who believes only what was signed: to compute the HMAC of each
message, and write its chunk to a file, in the same thread.
"""

from __future__ import annotations

import hashlib
import hmac
import random
import tempfile
import time
from pathlib import Path

from throwcollect.collect.coordinator.collection import TrialCollection
from throwcollect.dataset.creation import create
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import judge_episode
from throwcollect.episode.episode_message import Episode, pack, unpack
from throwcollect.plan.conditions import Settings
from throwcollect.plan.plan import Plan
from throwcollect.run_key import Signer
from throwcollect.tasks.task import task_of, trajectory_of

_SECRET = b"key of a run"
_SIGNER = Signer(_SECRET)


def measure(directory: Path) -> tuple[float, float]:
    """Episodes per second, fed in random order, and the raw limit.

    Args:
        directory: A finished dataset, whose episodes are collected once more.
    """
    dataset = Dataset.open(directory)
    messages = list(sign_episodes(dataset, _SIGNER).values())
    random.Random(0).shuffle(messages)
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        taken_in = _take_in(messages, dataset.plan, Path(scratch) / "data")
        return taken_in, _raw(messages, Path(scratch) / "raw")


def sign_episodes(dataset: Dataset, signer: Signer) -> dict[int, bytes]:
    """Make the messages that hand over the episodes of a dataset, by trial."""
    settings, columns = Settings(dataset.config), task_of(dataset.config).columns
    messages = {}
    for episode in dataset.episodes():
        config = dataset.plan.config_of(dataset.plan.trial(episode.header.trial))
        result = columns.to_json(judge_episode(config, episode))
        conditions = settings.conditions_of(settings.read_values(config), trajectory_of(config).digest)
        judged = Episode(episode.header, episode.chunk, result=result, conditions=conditions)
        messages[episode.header.trial] = pack(judged, signer)
    return messages


def _take_in(messages: list[bytes], plan: Plan, directory: Path) -> float:
    create(directory, plan)
    with TrialCollection.open(directory, say=lambda _: None) as collection:
        began = time.perf_counter()
        for message in messages:
            episode = unpack(message, _SIGNER)
            assert isinstance(episode, Episode)
            if not collection.take_in("/sim_0", episode):
                raise ValueError(f"trial {episode.header.trial} is refused")
        return len(messages) / (time.perf_counter() - began)


def _raw(messages: list[bytes], path: Path) -> float:
    chunks = [unpack(message, _SIGNER).chunk for message in messages]  # type: ignore[union-attr]
    began = time.perf_counter()
    with path.open("wb", buffering=0) as file:
        for message, chunk in zip(messages, chunks, strict=True):
            hmac.digest(_SECRET, message, hashlib.sha256)
            file.write(chunk.data)
    return len(messages) / (time.perf_counter() - began)
