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


def choose_rows(dataset: Dataset, trials: Iterable[int] | None) -> list[Row]:
    """Choose the rows of the table of throws that are shown: some trials in their order, or all that have an episode.

    Raises:
        ConfigError: If there is no such trial.
        DatasetError: If a trial has no episode, or none has one.
    """
    if trials is None:
        chosen: list[Row] = dataset.recorded.throws.to_pylist()
        if not chosen:
            raise DatasetError("no trial has an episode: there is nothing to show", path=dataset.directory)
        return chosen
    rows: list[Row] = []
    for number in trials:
        if not 0 <= number < len(dataset):
            raise ConfigError(f"{dataset.directory}: no trial {number}", expected=f"0 to {len(dataset) - 1}")
        # Rows are made one by one, as those of a million trials would take 3 GB.
        row = dataset[number].row
        if row["shard"] is None:
            reason = f"{row['outcome']}: {row['reason']}"
            raise DatasetError(f"trial {number} has no episode: {reason}", path=dataset.directory)
        rows.append(row)
    return rows
