"""Chooses the throws of a dataset that are shown, and the times at which they are shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throw import Throw
from throwcollect.errors import DatasetError


@dataclass(frozen=True)
class ShownThrow:
    """A throw with the configuration of its trial, and when it is shown.

    Attributes:
        start_ns: Stamp of its first sample in the file that viewers open [ns].
        path: Ball centre in world [m], shape ``(n_samples, 3)``.
    """

    throw: Throw
    config: Config
    start_ns: int
    path: NDArray[np.float64]


def choose_throws(dataset: Dataset, trials: Iterable[int] | None) -> Dataset:
    """Choose the throws that are shown: some trials in their order, or all that have an episode."""
    throws = dataset.recorded if trials is None else dataset.select(trials)
    if not len(throws):
        raise DatasetError("no trial has an episode: there is nothing to show", path=dataset.directory)
    return throws
