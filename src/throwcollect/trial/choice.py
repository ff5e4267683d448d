"""Which trials are looked at once more: a random choice that is always the same for the same seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def choose_trials(trials: Sequence[int], *, count: int, seed: int) -> list[int]:
    """Some of the trials, in their order.

    Args:
        trials: Numbers of trials.
        count: How many at most.
        seed: Root seed of the collection.
    """
    if count >= len(trials):
        return list(trials)
    picked = np.random.default_rng(seed).choice(len(trials), size=count, replace=False)
    return [trials[index] for index in sorted(picked.tolist())]
