"""Points of a parameter space: what samplers draw and tables hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Points:
    """Values of the swept keys, one row a trial.

    Attributes:
        keys: Dotted configuration keys, ``(n_keys,)``.
        values: In the units of the keys, shape ``(n_trials, n_keys)``.
    """

    keys: tuple[str, ...]
    values: NDArray[np.float64]

    def first(self, count: int) -> Points:
        """The first `count` points."""
        return Points(self.keys, self.values[:count])
