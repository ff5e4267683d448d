"""Datasets that others are made from, and the trials that are taken from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from throwcollect.dataset.reader import Dataset


@dataclass(frozen=True)
class Source:
    """A dataset and the trials that are taken from it.

    Attributes:
        dataset: The dataset.
        trials: Numbers of the trials, in the order in which they are taken; each has an episode.
        without_episode: Number of trials that were asked for but have no episode, by outcome.
    """

    dataset: Dataset
    trials: tuple[int, ...]
    without_episode: Mapping[str, int]


def source(dataset: Dataset, trials: Collection[int] | None = None) -> Source:
    """Take those of the given trials of a dataset, or of all its trials, that have an episode."""
    numbers = range(len(dataset.throws)) if trials is None else sorted(trials)
    outcomes = dataset.throws["outcome"].to_pylist()
    has_episode = dataset.throws["shard"].is_valid().to_pylist()
    missing = Counter(outcomes[number] for number in numbers if not has_episode[number])
    return Source(dataset, tuple(number for number in numbers if has_episode[number]), dict(sorted(missing.items())))
