"""Chooses the throws of a dataset that are shown, and the times at which they are shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import Row
from throwcollect.errors import ConfigError, DatasetError


@dataclass(frozen=True)
class ShownThrow:
    """A throw, with its row of the table and the configuration of its trial, and when it is shown.

    Attributes:
        start_ns: Stamp of its first sample in the file that viewers open [ns].
        path: Ball centre in world [m], shape ``(n_samples, 3)``.
    """

    row: Row
    config: Config
    start_ns: int
    path: NDArray[np.float64]


def choose_throws(dataset: Dataset, trials: Iterable[int] | None) -> Dataset:
    """Choose the throws that are shown: some trials in their order, or all that have an episode."""
    if trials is None:
        if not len(recorded := dataset.recorded):
            raise DatasetError("no trial has an episode: there is nothing to show", path=dataset.directory)
        return recorded
    numbers, known = list(trials), dataset["trial"]
    for number in numbers:
        if number not in known:
            expected = f"trials from {known[0]} to {known[-1]}"
            raise ConfigError(f"{dataset.directory}: no trial {number}", expected=expected)
    chosen = dataset.select(numbers)
    for throw in chosen:
        if not throw.recorded:
            reason = f"{throw.outcome}: {throw.reason}"
            raise DatasetError(f"trial {throw.trial} has no episode: {reason}", path=dataset.directory)
    return chosen
