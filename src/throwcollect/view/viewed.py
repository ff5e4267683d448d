"""A throw as viewers are shown it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.throws_table import Row


@dataclass(frozen=True)
class ViewedThrow:
    """A throw and when it is shown.

    Attributes:
        row: Its row of the table of throws.
        config: The configuration of its trial.
        start_ns: Stamp of its first sample in the file that viewers open [ns].
        path: Ball centre in world [m], shape ``(n_samples, 3)``.
    """

    row: Row
    config: Config
    start_ns: int
    path: NDArray[np.float64]
